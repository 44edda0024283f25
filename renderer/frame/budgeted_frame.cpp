#include "renderer/frame/budgeted_frame.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <optional>

namespace narpa {
namespace {

using BudgetKind = FrameBudget::Kind;
using Of = PassCosts::Of;
using Stage = SamplePlan::Stage;
using Fill = PixelFill::Stage;
using Tiles = FramePasses::Tiles;

using namespace tuning;

constexpr double kMaxRaysOfSunlight = 2;  ///< per sample: the camera's and the Sun's
/// Largest pass: what the account can hold, 2^32, less half a sample for each pixel (SamplePlan::whole).
constexpr double kMaxSamples = 4e9;

/// A frame begins with one sample per pixel, or with fewer and a reconstruction (pixel_fill.h) if not all fit.
/// Sun-only direct lighting traces the pixel centres, plans from them, and discards them where there are samples;
/// so does all other lighting if only few samples per pixel fit, because edges then cause most of the error. If
/// more fit, it takes the first sample of each pixel's sequence and keeps it. Where direct sunlight is separate,
/// further samples of it are planned from centres that are then discarded.
class BudgetFrame {
public:
    BudgetFrame(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene, const Camera& camera,
                const BodyPoses& at, const CameraPose& pose, const FrameSettings& settings, RadianceImage& out,
                std::vector<float>* variance)
        : passes_(passes),
          costs_(costs),
          budget_(settings.budget),
          start_ns_(now_ns()),
          slack_ns_(std::max(kMinSlack_ns, (budget_.deadline_ns - start_ns_) / kSlackPart)),
          settings_(settings),
          centre_settings_(by_direct_light(with_spp(settings, kCentreFootprint_spp))),
          sample_settings_(with_spp(settings, kSampleFootprint_spp)),
          centre_(make_frame(render_scene, at, camera, pose, centre_settings_)),
          sample_(make_frame(render_scene, at, camera, pose, sample_settings_)),
          adaptive_(sample_.parts == LightParts::direct && settings.mechanisms.sample_plan),
          separate_sunlight_(sample_.thins_paths && settings.mechanisms.sample_plan),
          separate_emission_(sample_.parts == LightParts::both && !sample_.thins_paths &&
                             settings.mechanisms.sample_plan),
          out_(out),
          variance_(variance) {}

    FrameAccount make() {
        account_.step = FrameStep::nothing;
        begin(adaptive_ || separate_sunlight_ ? centre_ : sample_);
        if (separate_sunlight_ && worth_sunlight() && plan_sunlight())
            take_first_samples(limit());
        else if (!(separate_emission_ && worth_sunlight() && plan_emission_and_take_first_samples()))
            take_first_image();
        if (passes_.pixels() == 0 && account_.step == FrameStep::one_sample)
            account_.standard_error = 0;  // nothing in view
        else if (account_.step == FrameStep::one_sample && !filled_ && (!adaptive_ || worth_planning()))
            refine();
        show();
        account_.phase_ns = passes_.times();
        return account_;
    }

private:
    enum class ToShow : std::uint8_t { nothing, centres, filled, means };

    static FrameSettings with_spp(FrameSettings s, int spp) {
        s.spp = spp;
        return s;
    }
    static FrameSettings by_direct_light(FrameSettings s) {
        s.method = RenderSettings::Method::direct;
        return s;
    }

    void begin(const Frame& f) {
        frame_ = &f;
        passes_.begin(f, sample_.lens);
        passes_.keep_fill();
        if (!adaptive_) passes_.make_plan(sample_, false);
    }

    // Remaining budget.
    [[nodiscard]] std::uint64_t rays_left() const { return budget_.rays - std::min(budget_.rays, rays_); }
    [[nodiscard]] std::int64_t time_given() const { return budget_.deadline_ns - start_ns_; }
    [[nodiscard]] std::int64_t ns_left() const {
        return budget_.deadline_ns - slack_ns_ - (filled_ ? ns_to_show_filled() : ns_to_show()) - now_ns();
    }
    [[nodiscard]] std::int64_t ns_to_show() const { return costs_.expected_ns(Of::show, out_.pixels.size()); }
    [[nodiscard]] std::int64_t ns_to_show_filled() const {
        const auto lattices = static_cast<std::uint64_t>(passes_.fill().lattices_left());
        return ns_to_show() + costs_.expected_ns(Of::reconstruction, lattices * passes_.pixels());
    }
    [[nodiscard]] PassLimit limit() const {
        PassLimit l;
        if (budget_.kind == BudgetKind::rays) l.rays = rays_left();
        if (budget_.kind == BudgetKind::time) l.until_ns = now_ns() + ns_left();
        return l;
    }

    /// Accounts for a pass; false if it is incomplete and does not count. `instead`: it replaces the previous
    /// passes.
    bool account_for(const PassCount& pass, const PassLimit& l, bool instead) {
        if (!pass.complete) {
            // Deterministic: the point at which the threads gave up must not decide what comes next.
            const std::uint64_t lost = budget_.kind == BudgetKind::rays ? l.rays : pass.rays;
            rays_ += lost;
            account_.rays_discarded += lost;
            return false;
        }
        if (instead) discard();
        rays_ += pass.rays;
        account_.rays += pass.rays;
        account_.samples += pass.samples;
        return true;
    }

    /// The previous passes do not count.
    void discard() {
        account_.rays_discarded += account_.rays;
        account_.rays = account_.samples = 0;
        account_.passes = {};
        fills_ = 0;
    }

    /// The visible tiles and the G-buffer belong to one kind of frame.
    void change_to(const Frame& f) {
        if (frame_ == &f) return;
        show();
        begin(f);
    }

    bool take_centres(FrameStep step, const PassLimit& l) {
        change_to(centre_);
        const PassCount pass = passes_.centres(centre_, l);
        costs_.record(Of::centres, pass.samples, pass.wall_ns);
        if (!account_for(pass, l, true)) return false;
        account_.step = step;
        to_show_ = ToShow::centres;
        return true;
    }

    bool take_first_samples(const PassLimit& l, Tiles which = Tiles::all) {
        change_to(sample_);
        const PassCount pass = passes_.refine(sample_, SamplePlan::none(), SamplePlan::samples_each(1), l, which);
        if (which == Tiles::all) costs_.record(Of::samples, pass.samples, pass.wall_ns);
        if (!account_for(pass, l, which != Tiles::all_but_pilot)) return false;
        rays_each_ = rays_each(pass);
        mostly_separate_ = static_cast<double>(pass.separate) > kMinSeparate * static_cast<double>(pass.met);
        if (which == Tiles::pilot) return true;
        account_.step = FrameStep::one_sample;
        to_show_ = ToShow::means;
        stage_ = SamplePlan::samples_each(1);
        return true;
    }
    bool take_one_sample(const PassLimit& l) {
        return adaptive_ ? take_centres(FrameStep::one_sample, l) : take_first_samples(l);
    }

    [[nodiscard]] bool worth_sunlight() const {
        const auto pixels = static_cast<double>(passes_.pixels());
        switch (budget_.kind) {
            case BudgetKind::samples:
            case BudgetKind::aim: return false;
            case BudgetKind::passes: return budget_.passes[kSunlightPass] > 0;
            case BudgetKind::rays:
                return separate_sunlight_ && static_cast<double>(budget_.rays) >= kMinRaysForSunlight * pixels;
            case BudgetKind::time:
                return costs_.known(Of::samples) && worth_planning() &&
                       static_cast<double>(costs_.fitting(Of::samples, ns_left())) >=
                           (separate_emission_ ? kUniformSamplesBesideEmission : kMinSamplesForSunlight) * pixels;
        }
        return false;
    }
    /// Takes the centres, which give a direct-light image to show, and plans the sunlight samples from them.
    bool plan_sunlight() {
        if (!take_centres(FrameStep::no_indirect, limit())) return false;
        const std::int64_t start = now_ns();
        passes_.plan_sunlight(centre_);
        costs_.record(Of::plan, passes_.pixels(), now_ns() - start);
        return sunlight_planned_ = true;
    }
    /// The same for emission in view; then takes one sample per pixel. False if that did not fit.
    bool plan_emission_and_take_first_samples() {
        const PassLimit l = limit();
        const PassCount pass = passes_.centres(sample_, l, false);
        if (!account_for(pass, l, false)) return false;
        discard();
        const std::int64_t start = now_ns();
        sunlight_planned_ = passes_.plan_sunlight(sample_);
        costs_.record(Of::plan, passes_.pixels(), now_ns() - start);
        if (take_first_samples(limit())) return true;
        return sunlight_planned_ = false;
    }
    /// True if centres and one sample per pixel are expected to fit; samples of emission get the rest. A pass that
    /// does not fit loses its rays, and the pilot pass of a small image says little.
    [[nodiscard]] bool emission_fits() const {
        const auto pixels = static_cast<double>(passes_.pixels());
        const double pilot_tiles = std::max(1.0, pixels / (kTilePixels * kPilotPart));
        return (rays_each_.sample + rays_each_.path + 1) * pixels * (1 + 1 / std::sqrt(pilot_tiles)) <=
               kMaxPilotPrediction * static_cast<double>(rays_left());
    }
    /// Two samples per pixel are needed to estimate the error of paths.
    [[nodiscard]] bool two_samples_fit() const {
        const auto pixels = static_cast<double>(passes_.pixels());
        switch (budget_.kind) {
            case BudgetKind::rays:
                return (rays_each_.sample + rays_each_.path) * pixels <
                       kFirstPassRays *
                           (static_cast<double>(rays_left()) - for_sunlight(static_cast<double>(budget_.rays)));
            case BudgetKind::time:
                return static_cast<double>(costs_.fitting(Of::samples, ns_for_samples())) * kFirstPassTime >=
                       pixels;
            default: return true;
        }
    }

    void take_first_image() {
        if (passes_.pixels() == 0 && budget_.kind != BudgetKind::passes) {  // nothing but the background
            take_one_sample({});
            return;
        }
        switch (budget_.kind) {
            case BudgetKind::samples:
            case BudgetKind::aim: break;
            case BudgetKind::passes: replay_first_image(); break;
            case BudgetKind::time:
                if (!take_if_affordable()) fill();
                break;
            case BudgetKind::rays:
                if (adaptive_ && kAllCentresRays * static_cast<double>(passes_.pixels()) <=
                                     static_cast<double>(rays_left()))  // the camera's and the Sun's
                    take_one_sample(limit());
                else if (adaptive_ || !take_pilot_and_rest())
                    fill();
                break;
        }
    }

    /// Takes one sample per pixel if that is expected to fit well, of paths if a few are; a tenth of the time left
    /// is kept for a coarser image in case it takes much longer.
    bool take_if_affordable() {
        const std::int64_t left = ns_left();
        const Of one = adaptive_ ? Of::centres : Of::samples;
        const double expected =
            static_cast<double>(costs_.expected_ns(one, (adaptive_ ? 1 : uniform_samples()) * passes_.pixels()));
        if (!costs_.known(one) || expected > kMaxFirstTime * static_cast<double>(left)) return false;
        PassLimit most = limit();
        most.until_ns -= left / 10;
        return take_one_sample(most);
    }
    [[nodiscard]] FrameStep recorded_step() const { return static_cast<FrameStep>(budget_.step); }
    void replay_first_image() {
        if (recorded_step() == FrameStep::nothing) return;
        if (recorded_step() != FrameStep::refined && budget_.passes[0] > 0)
            fill();
        else if (recorded_step() == FrameStep::no_indirect)
            take_centres(FrameStep::no_indirect, {});
        else
            take_one_sample({});
    }

    /// Light by paths is sampled uniformly if so many samples of each pixel are expected to fit.
    [[nodiscard]] std::uint64_t uniform_samples() const {
        return sample_.thins_paths ? kUniformSamples : separate_emission_ ? kUniformSamplesBesideEmission : 1;
    }
    /// A pilot pass over a sixteenth of the tiles measures the number of rays per sample; the other tiles follow if
    /// a few samples of each pixel are expected to fit.
    bool take_pilot_and_rest() {
        if (2 * uniform_samples() * passes_.pixels() > rays_left()) return false;
        PassLimit part = limit();
        part.rays /= 2;
        if (!take_first_samples(part, Tiles::pilot)) return false;
        if (separate_emission_) {
            discard();
            return emission_fits() && plan_emission_and_take_first_samples();
        }
        const std::uint64_t taken = account_.samples;
        const PassLimit rest = limit();
        if ((rays_each_.sample + rays_each_.path) *
                static_cast<double>(uniform_samples() * passes_.pixels() - taken) <=
            kMaxPilotPrediction * static_cast<double>(rest.rays))
            return take_first_samples(rest, Tiles::all_but_pilot);
        discard();
        return false;
    }

    // Less than one sample per pixel.

    /// Traces the pixels of ever finer lattices, those with the largest contrasts first.
    void fill() {
        filled_ = true;
        // If even a few paths do not fit, the image shows direct light alone.
        direct_alone_ = !adaptive_ && !paths_fit();
        int first = direct_alone_ ? 0 : take_first_lattice(coarse());
        if (first == 0 && !adaptive_) {
            discard();
            direct_alone_ = true;
            first = take_first_lattice(centre_);
        }
        if (first == 0) return;
        if (first == 4 && !direct_alone_ && worth_sparse(2) && refine_coarse()) return;
        const int last = direct_alone_ ? 2 : 1;
        for (int stride = first; stride >= last; stride /= 2) {
            if (stride < first && !take_lattice(*frame_, stride)) return;
            account_.step = step_of(stride);
            // A replay takes one pass for one pixel in 2 x 2, whole or in part, before further samples.
            const bool one_pass = first == 2 || fills_ == 2;
            if (stride == 2 && one_pass && !direct_alone_ && worth_sparse(1) && refine_sparse()) return;
        }
    }
    /// The first image: one pixel in 2 x 2, whose batches are full, if that is expected to fit; else one in 4 x 4.
    /// It is completed even if it is late: a coarser one would take two thirds of its time. Returns the stride, 0
    /// if nothing was taken.
    int take_first_lattice(const Frame& f) {
        if (adaptive_)
            frame_ = &f;  // nothing is traced yet
        else
            change_to(f);
        passes_.begin_fill();
        passes_.plan_fill(2, true);
        const bool fits = static_cast<double>(passes_.fill().total()) <= pixels_of_first_lattice();
        if (!fits) passes_.plan_fill(4, true);
        const PassLimit most = budget_.kind == BudgetKind::time ? PassLimit{} : limit();
        const PixelFill& plan = passes_.fill();
        const Fill few = first_few();
        if (plan.total(few) > 0 && !take_planned(f, {}, few, most)) return 0;
        const std::uint64_t rest = plan.total() - plan.total(few);
        if (rest > 0 &&
            (static_cast<double>(rest) > fitting_pixels() || !take_planned(f, few, PixelFill::all(), limit())))
            return 0;
        account_.step = step_of(4);
        to_show_ = ToShow::filled;
        account_.coarsest_late = budget_.kind == BudgetKind::time && ns_left() < 0;
        return fits ? 2 : 4;
    }
    /// The first pass of the first lattice: all of it, but with a budget in rays a few paths that measure the
    /// number of rays of each.
    [[nodiscard]] Fill first_few() const {
        const PixelFill& plan = passes_.fill();
        if (budget_.kind == BudgetKind::passes) return plan.reach({}, budget_.passes[0]);
        if (budget_.kind == BudgetKind::rays && !by_centres_alone())
            return plan.reach({}, static_cast<double>(plan.total()) / kPilotPart);
        return PixelFill::all();
    }
    /// Every sample is a centre with direct light by the Sun alone: a camera ray and a Sun ray.
    [[nodiscard]] bool by_centres_alone() const { return adaptive_ || direct_alone_; }
    [[nodiscard]] Of cost_of_one() const { return by_centres_alone() ? Of::centres : Of::paths; }
    [[nodiscard]] double pixels_of_first_lattice() const {
        switch (budget_.kind) {
            case BudgetKind::rays: return 0;  // no batch that is not full costs more
            case BudgetKind::time:
                return costs_.known(cost_of_one())
                           ? kMaxFirstTime * static_cast<double>(costs_.fitting(cost_of_one(), ns_left()))
                           : 0;
            default: return fitting_pixels();
        }
    }
    /// True if the lattice is complete.
    bool take_lattice(const Frame& f, int stride) {
        plan_fill(stride);
        const PixelFill& plan = passes_.fill();
        for (Fill from{}; plan.total() > plan.total(from);) {
            const Fill to = next_fill(from);
            const auto pixels = static_cast<double>(plan.total(to) - plan.total(from));
            if (pixels < kMinFill * static_cast<double>(plan.total()) || !take_planned(f, from, to, limit()))
                return false;
            from = to;
        }
        return true;
    }
    /// `lattices`: to be planned before.
    [[nodiscard]] bool worth_sparse(std::uint64_t lattices) const {
        if (!settings_.mechanisms.sample_plan) return false;
        if (budget_.kind == BudgetKind::passes && recorded_step() != FrameStep::sparse) return false;
        // If all light has noise, pixels that keep their centres because these show little contrast are too dark in
        // the mean. Their error remains below that of reconstruction, but not below that of centres everywhere.
        if (sample_.parts == LightParts::path && static_cast<double>(passes_.pixels()) <= fitting_pixels())
            return false;
        if (budget_.kind != BudgetKind::time) return true;
        const std::int64_t plans = costs_.expected_ns(Of::reconstruction, lattices * passes_.pixels()) +
                                   costs_.expected_ns(Of::plan, passes_.pixels());
        return static_cast<double>(plans) <= kMaxSparsePlan * static_cast<double>(ns_left());
    }
    /// After one pixel in 4 x 4: those in 2 x 2 where contrasts are large, then as `refine_sparse`. False: the
    /// pixels that fit are too few.
    bool refine_coarse() {
        const double rest = static_cast<double>(passes_.pixels()) / 4 - static_cast<double>(account_.samples);
        if (budget_.kind != BudgetKind::passes && fitting_pixels() < kMinCoarseFill * rest) return false;
        if (!take_part(2)) return false;
        account_.step = FrameStep::sparse;
        refine_sparse();
        return true;
    }
    /// Once the contrasts of one pixel in 2 x 2 are known, more samples where these are large gain more than the
    /// first samples of the pixels where they are small.
    bool refine_sparse() {
        if (take_part(1)) {
            reconstruct();
            refine(FrameStep::sparse);
        }
        return true;
    }
    /// Traces the pixels of a lattice that have the largest contrasts, with a part of what is left of the budget.
    /// False if nothing was traced.
    bool take_part(int stride) {
        if (fills_ == most_fills()) return false;
        plan_fill(stride);
        const PixelFill& plan = passes_.fill();
        const double fitting = fitting_pixels();
        const bool all = stride == 1 && static_cast<double>(plan.total()) +
                                                (kAllCentresRays / 2 - 1) * static_cast<double>(passes_.pixels()) <=
                                            fitting;
        const Fill to = budget_.kind == BudgetKind::passes ? next_fill({})
                        : all                              ? PixelFill::all()
                                                           : plan.reach({}, kSparseFill * fitting);
        return plan.total(to) > 0 && take_planned(*frame_, {}, to, limit());
    }
    void plan_fill(int stride) {
        const std::int64_t start = now_ns();
        passes_.plan_fill(stride, false);
        costs_.record(Of::reconstruction, passes_.pixels(), now_ns() - start);
    }
    void reconstruct() {
        const auto lattices = static_cast<std::uint64_t>(passes_.fill().lattices_left());
        const std::int64_t start = now_ns();
        passes_.reconstruct();
        // At most: where nothing was traced since the plan, nothing is left to do.
        if (passes_.fill().reconstructs_all())
            costs_.record(Of::reconstruction, lattices * passes_.pixels(), now_ns() - start);
    }
    [[nodiscard]] FrameStep step_of(int stride) const {
        if (direct_alone_) return FrameStep::no_indirect;
        return stride == 1 ? FrameStep::one_sample : stride == 2 ? FrameStep::coarse_2 : FrameStep::coarse_4;
    }
    bool take_planned(const Frame& f, Fill from, Fill to, const PassLimit& l) {
        const PassCount pass = passes_.fill(f, from, to, l);
        // A batch that is not full takes as long.
        costs_.record(cost_of_one(), kLanes * pass.batches, pass.wall_ns);
        if (!account_for(pass, l, false)) return false;
        if (!by_centres_alone()) rays_each_ = rays_each(pass);
        account_.passes[fills_++] =
            static_cast<std::uint32_t>(passes_.fill().total(to) - passes_.fill().total(from));
        return true;
    }
    [[nodiscard]] Fill next_fill(Fill from) const {
        const PixelFill& plan = passes_.fill();
        const auto left = static_cast<double>(plan.total() - plan.total(from));
        double pixels = fitting_pixels();
        // The first pixels of a lattice, at edges, may cost more than those before.
        if (budget_.kind == BudgetKind::time) pixels *= from.level == 0 ? kFirstFillTime : kNextFillTime;
        if (budget_.kind == BudgetKind::rays && !by_centres_alone() && from.level == 0) pixels *= kFirstFillRays;
        if (fills_ == most_fills()) return from;
        // The account has room for one more pass: only if that takes all.
        if (fills_ + 1 == most_fills() && budget_.kind != BudgetKind::passes && pixels < left) return from;
        return pixels >= left ? PixelFill::all() : plan.reach(from, pixels);
    }
    /// Passes of the account that may fill the image.
    [[nodiscard]] std::size_t most_fills() const {
        return separate_sunlight_ || separate_emission_ ? kSunlightPass : kMaxPasses;
    }
    /// Pixels that fit into the rest of the budget.
    [[nodiscard]] double fitting_pixels() const {
        switch (budget_.kind) {
            case BudgetKind::passes: return fills_ < most_fills() ? budget_.passes[fills_] : 0;
            case BudgetKind::rays:
                return static_cast<double>(rays_left()) /
                       (by_centres_alone() ? 2 : (rays_each_.sample + rays_each_.path) / kNextPassRaysOfPaths);
            case BudgetKind::time:
                return kFilledLanes * static_cast<double>(costs_.fitting(cost_of_one(), ns_left()));
            default: return 0;
        }
    }
    /// True if a path for one pixel in eight is expected to fit.
    [[nodiscard]] bool paths_fit() const {
        switch (budget_.kind) {
            case BudgetKind::passes: return recorded_step() != FrameStep::no_indirect;
            case BudgetKind::rays:
                return kMinRaysOfPaths * static_cast<double>(passes_.pixels()) <= static_cast<double>(rays_left());
            default: return costs_.expected_ns(Of::paths, passes_.pixels() / 8) < ns_left();
        }
    }
    /// The centres as in an image of one sample per pixel.
    const Frame& coarse() {
        coarse_settings_ = with_spp(settings_, 1);
        return coarse_.emplace(
            make_frame(centre_.render_scene, centre_.at, centre_.camera, centre_.pose, coarse_settings_));
    }

    /// Further samples, pass by pass.
    void refine(FrameStep step = FrameStep::refined) {
        if (filled_) sample_.transport.path.first_survival = frame_->transport.path.first_survival;
        if (by_contrast()) {
            const std::int64_t start = now_ns();
            passes_.make_plan(*frame_, true);
            costs_.record(Of::plan, passes_.pixels(), now_ns() - start);
            account_.standard_error = passes_.standard_error();
        }
        if (sunlight_planned_ && separate_sunlight_) sunlight_planned_ = mostly_separate_ && two_samples_fit();
        const std::size_t passes = most_fills();
        for (std::size_t i = fills_; i < passes; ++i) {
            const Stage next = sunlight_planned_ && separate_sunlight_ ? SamplePlan::whole(wanted(i)) : wanted(i);
            const std::uint64_t samples = passes_.plan().total(next) - passes_.plan().total(stage_);
            if (samples == 0 && i == fills_ && budget_.kind == BudgetKind::time && worth_a_pass())
                costs_.decay(Of::samples);
            if (samples == 0) break;
            if (to_show_ == ToShow::means) show();  // an abandoned pass invalidates the means
            const PassLimit l = limit();
            const PassCount pass = passes_.refine(sample_, stage_, next, l);
            costs_.record(Of::samples, pass.samples, pass.wall_ns);
            if (!account_for(pass, l, false)) return;
            account_.step = step;
            account_.passes[i] = static_cast<std::uint32_t>(samples);
            to_show_ = ToShow::means;
            stage_ = next;
            rays_each_ = rays_each(pass);
        }
        if (sunlight_planned_ && (separate_emission_ || SamplePlan::reaches(stage_, 2))) refine_sunlight();
    }

    /// Spends what the uniform passes have left of the budget.
    void refine_sunlight() {
        const std::uint32_t each = SamplePlan::least_of(stage_);
        const SamplePlan& plan = passes_.sunlight_plan();
        const Stage to = plan.reach_beyond(each, sunlight_samples());
        const std::uint64_t samples = plan.total_beyond(each, to);
        if (samples == 0) return;
        if (to_show_ == ToShow::means) show();
        const PassLimit l = limit();
        const PassCount pass = passes_.refine_sunlight(sample_, stage_, to, l);
        costs_.record(Of::sunlight, pass.samples, pass.wall_ns);
        if (!account_for(pass, l, false)) return;
        account_.passes[kSunlightPass] = static_cast<std::uint32_t>(samples);
        to_show_ = ToShow::means;
    }
    [[nodiscard]] double sunlight_samples() const {
        if (budget_.kind == BudgetKind::passes) return budget_.passes[kSunlightPass];
        if (budget_.kind == BudgetKind::rays)
            return std::min(static_cast<double>(rays_left()) / (separate_emission_ ? 1 : kMaxRaysOfSunlight),
                            kMaxSamples);
        return std::min(kSunlightPassTime * static_cast<double>(costs_.fitting(Of::sunlight, ns_left())),
                        kMaxSamples);
    }

    /// Samples are planned by the contrasts of the centres.
    [[nodiscard]] bool by_contrast() const { return adaptive_ || filled_; }
    struct RaysEach {
        double sample = 2, path = 0;  ///< default for Sun-only direct lighting: one camera ray and one Sun ray
    };
    [[nodiscard]] RaysEach rays_each(const PassCount& pass) const {
        const auto samples = static_cast<double>(std::max<std::uint64_t>(pass.samples, 1));
        const auto paths = static_cast<double>(std::max<std::uint64_t>(pass.paths, 1));
        return {static_cast<double>(pass.rays - pass.path_rays) / samples,
                static_cast<double>(pass.path_rays) / paths};
    }
    /// Target stage of the next pass; equal to the present one if there is none.
    [[nodiscard]] Stage wanted(std::size_t pass) const {
        const SamplePlan& plan = passes_.plan();
        if (budget_.kind == BudgetKind::passes)
            return recorded_step() == FrameStep::refined || recorded_step() == FrameStep::sparse
                       ? plan.reach(stage_, budget_.passes[pass])
                       : stage_;
        if (budget_.kind == BudgetKind::rays) {
            const double left = static_cast<double>(rays_left()) - for_sunlight(static_cast<double>(budget_.rays));
            if (left < kMinRemainder * static_cast<double>(budget_.rays)) return stage_;
            const double part = adaptive_        ? kNextPassRays
                                : pass == fills_ ? (filled_ ? kFirstSparseRays : kFirstPassRays)
                                                 : kNextPassRaysOfPaths;
            // By contrast, samples come in powers of two. In light of two parts, half of these have paths.
            const double with_paths = !by_contrast() ? 0 : sample_.thins_paths ? 0.5 : 1;
            const double each = rays_each_.sample + with_paths * rays_each_.path;
            return plan.reach(stage_, std::min(part * left, kMaxSamples), each, rays_each_.path);
        }
        if (!worth_a_pass()) return stage_;
        const auto fitting = static_cast<double>(costs_.fitting(Of::samples, ns_for_samples()));
        return plan.reach(
            stage_, std::min(std::floor((pass == fills_ ? kFirstPassTime : kNextPassTime) * fitting), kMaxSamples));
    }
    [[nodiscard]] bool worth_a_pass() const {
        return static_cast<double>(ns_for_samples()) >= kMinRemainder * static_cast<double>(time_given());
    }
    [[nodiscard]] std::int64_t ns_for_samples() const {
        return ns_left() - static_cast<std::int64_t>(for_sunlight(static_cast<double>(time_given())));
    }
    /// The part of the budget reserved for sunlight samples.
    [[nodiscard]] double for_sunlight(double budget) const {
        return sunlight_planned_ ? (separate_emission_ ? kEmissionPart : kSunlightPart) * budget : 0;
    }

    /// Planning cannot be interrupted, so it is begun only if time is left for samples.
    [[nodiscard]] bool worth_planning() const {
        if (budget_.kind != BudgetKind::time) return true;
        const auto rest = static_cast<std::int64_t>(2 * kMinRemainder * static_cast<double>(time_given()));
        return costs_.expected_ns(Of::plan, passes_.pixels()) + rest <= ns_left();
    }

    void show() {
        if (to_show_ == ToShow::nothing) return;
        if (to_show_ == ToShow::filled) reconstruct();
        const std::int64_t start = now_ns();
        if (to_show_ == ToShow::centres) passes_.show_centres(centre_, out_, variance_);
        if (to_show_ == ToShow::filled) passes_.show_filled(*frame_, out_, variance_);
        if (to_show_ == ToShow::means) passes_.show_means(sample_, stage_, filled_, out_, variance_);
        // What paths would have added is not known.
        if (account_.step != FrameStep::no_indirect) account_.standard_error = passes_.standard_error();
        costs_.record(Of::show, out_.pixels.size(), now_ns() - start);
        to_show_ = ToShow::nothing;
    }

    FramePasses& passes_;
    PassCosts& costs_;
    const FrameBudget budget_;
    const std::int64_t start_ns_, slack_ns_;
    const FrameSettings &settings_, centre_settings_, sample_settings_;
    const Frame centre_;
    Frame sample_;
    const bool adaptive_, separate_sunlight_, separate_emission_;
    RadianceImage& out_;
    std::vector<float>* const variance_;

    FrameAccount account_;
    const Frame* frame_ = nullptr;  ///< the frame whose tiles and G-buffer the passes hold
    std::uint64_t rays_ = 0;        ///< charged to the budget
    RaysEach rays_each_;            ///< of the last pass of samples
    bool sunlight_planned_ = false, mostly_separate_ = false;
    ToShow to_show_ = ToShow::nothing;
    FrameSettings coarse_settings_;
    std::optional<Frame> coarse_;
    bool filled_ = false;        ///< the image has less than one sample per pixel, or had
    bool direct_alone_ = false;  ///< filled without paths, although the scene sets them
    std::size_t fills_ = 0;      ///< passes that filled the image
    Stage stage_ = SamplePlan::none();
};

}  // namespace

FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const CameraPose& pose,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance) {
    return BudgetFrame(passes, costs, render_scene, camera, at, pose, settings, out, variance).make();
}

}  // namespace narpa
