#include "renderer/frame/budgeted_frame.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace narpa {
namespace {

using BudgetKind = FrameBudget::Kind;
using Of = PassCosts::Of;
using Stage = SamplePlan::Stage;
using Tiles = FramePasses::Tiles;

using namespace tuning;

constexpr double kMaxRaysOfSunlight = 2;  ///< per sample: the camera's and the Sun's
/// Largest pass: what the account can hold, 2^32, less half a sample for each pixel (SamplePlan::whole).
constexpr double kMaxSamples = 4e9;

/// A frame begins with one sample per pixel. Sun-only direct lighting traces the pixel centres, plans from them,
/// and discards them where there are samples; all other lighting takes the first sample of each pixel's sequence
/// and keeps it. Where direct sunlight is separate, further samples of it are planned from centres that are then
/// discarded.
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
          centre_settings_(by_direct_light(with_spp(settings, kCentreFootprint_spp))),
          sample_settings_(with_spp(settings, kSampleFootprint_spp)),
          centre_(make_frame(render_scene, at, camera, pose, centre_settings_)),
          sample_(make_frame(render_scene, at, camera, pose, sample_settings_)),
          has_indirect_(settings.method == RenderSettings::Method::path),
          adaptive_(sample_.parts == LightParts::direct && settings.mechanisms.sample_plan),
          separate_sunlight_(sample_.parts == LightParts::both && settings.mechanisms.sample_plan),
          out_(out),
          variance_(variance) {}

    FrameAccount make() {
        account_.step = FrameStep::nothing;
        begin(adaptive_ || separate_sunlight_ ? centre_ : sample_);
        if (separate_sunlight_ && worth_sunlight() && plan_sunlight())
            take_first_samples(limit());
        else
            take_first_image();
        if (account_.step == FrameStep::nothing) {  // the pilot pass is not part of the image
            account_.rays_discarded += account_.rays;
            account_.rays = account_.samples = 0;
        }
        if (passes_.pixels() == 0 && account_.step == FrameStep::one_sample)
            account_.standard_error = 0;  // nothing in view
        else if (account_.step == FrameStep::one_sample && (!adaptive_ || worth_planning()))
            refine();
        show();
        account_.phase_ns = passes_.times();
        return account_;
    }

private:
    enum class ToShow : std::uint8_t { nothing, centres, means };

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
        if (!adaptive_) passes_.make_plan(sample_, false);
    }

    // Remaining budget.
    [[nodiscard]] std::uint64_t rays_left() const { return budget_.rays - std::min(budget_.rays, rays_); }
    [[nodiscard]] std::int64_t time_given() const { return budget_.deadline_ns - start_ns_; }
    [[nodiscard]] std::int64_t ns_left() const {
        return budget_.deadline_ns - slack_ns_ - costs_.expected_ns(Of::show, out_.pixels.size()) - now_ns();
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
        if (instead) {
            account_.rays_discarded += account_.rays;
            account_.rays = account_.samples = 0;
        }
        rays_ += pass.rays;
        account_.rays += pass.rays;
        account_.samples += pass.samples;
        return true;
    }

    /// The visible tiles and the G-buffer belong to one kind of frame.
    void change_to(const Frame& f) {
        if (frame_ == &f) return;
        show();
        begin(f);
    }

    bool take_centres(int stride, int made, FrameStep step, const PassLimit& l) {
        change_to(centre_);
        const PassCount pass = passes_.centres(centre_, stride, made, l);
        // One pixel in 4 x 4 fills a quarter of a batch, which predicts little of the others' cost.
        if (stride < 4 || !costs_.known(Of::centres)) costs_.record(Of::centres, pass.samples, pass.wall_ns);
        if (!account_for(pass, l, made == 0)) return false;
        account_.step = step;
        to_show_ = ToShow::centres;
        stride_ = stride;
        return true;
    }
    bool take_centres(int stride, int made, FrameStep step) { return take_centres(stride, made, step, limit()); }

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
        return adaptive_ ? take_centres(1, 0, FrameStep::one_sample, l) : take_first_samples(l);
    }

    [[nodiscard]] bool worth_sunlight() const {
        const auto pixels = static_cast<double>(passes_.pixels());
        switch (budget_.kind) {
            case BudgetKind::samples: return false;
            case BudgetKind::passes: return budget_.passes[kSunlightPass] > 0;
            case BudgetKind::rays: return static_cast<double>(budget_.rays) >= kMinRaysForSunlight * pixels;
            case BudgetKind::time:
                return costs_.known(Of::samples) && worth_planning() &&
                       static_cast<double>(costs_.fitting(Of::samples, ns_left())) >=
                           kMinSamplesForSunlight * pixels;
        }
        return false;
    }
    /// Takes the centres, which give a direct-light image to show, and plans the sunlight samples from them.
    bool plan_sunlight() {
        if (!take_centres(1, 0, FrameStep::no_indirect)) return false;
        const std::int64_t start = now_ns();
        passes_.plan_sunlight(centre_);
        costs_.record(Of::plan, passes_.pixels(), now_ns() - start);
        return sunlight_planned_ = true;
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
        switch (budget_.kind) {
            case BudgetKind::samples: break;
            case BudgetKind::passes: replay_first_image(); break;
            case BudgetKind::time:
                if (!take_if_affordable(1)) from_coarse_to_fine();
                break;
            case BudgetKind::rays:
                if (adaptive_ && 2 * passes_.pixels() <= rays_left())  // the camera's and the Sun's
                    take_one_sample(limit());
                else if (adaptive_ || !take_pilot_and_rest())
                    from_coarse_to_fine();
                break;
        }
    }

    /// Takes a pass that covers all pixels if it is expected to take at most half of the time left; a quarter of
    /// that time is kept for a coarser pass in case it takes much longer. Stride 1: one sample per pixel.
    bool take_if_affordable(int stride) {
        const Of cost = stride == 1 && !adaptive_ ? Of::samples : Of::centres;
        const auto pieces = passes_.pixels() / static_cast<std::uint64_t>(stride * stride);
        const std::int64_t left = ns_left();
        if (!costs_.known(cost) || costs_.expected_ns(cost, pieces) > left / 2) return false;
        PassLimit most = limit();
        most.until_ns -= left / 4;
        return stride == 1 ? take_one_sample(most) : take_centres(stride, 0, FrameStep::coarse_2, most);
    }

    [[nodiscard]] FrameStep recorded_step() const { return static_cast<FrameStep>(budget_.step); }
    void replay_first_image() {
        switch (recorded_step()) {
            case FrameStep::refined:
            case FrameStep::one_sample: take_one_sample({}); break;
            case FrameStep::no_indirect: take_centres(1, 0, FrameStep::no_indirect); break;
            case FrameStep::coarse_2: take_centres(2, 0, FrameStep::coarse_2); break;
            case FrameStep::coarse_4: take_centres(4, 0, FrameStep::coarse_4); break;
            case FrameStep::nothing: break;
        }
    }

    /// A pilot pass over a sixteenth of the tiles measures the number of rays per sample; the other tiles follow if
    /// they are nearly certain to fit. Enough rays are kept for a coarse image in case they do not.
    bool take_pilot_and_rest() {
        if (passes_.pixels() > rays_left()) return false;
        PassLimit part = limit();
        part.rays /= 2;
        if (!take_first_samples(part, Tiles::pilot)) return false;
        const std::uint64_t taken = account_.samples;
        PassLimit rest = limit();
        rest.rays -= std::min(rest.rays, passes_.pixels() / kPixelsPerCoarseRay);
        if ((rays_each_.sample + rays_each_.path) * static_cast<double>(passes_.pixels() - taken) >
            kMaxPilotPrediction * static_cast<double>(rest.rays))
            return false;
        return take_first_samples(rest, Tiles::all_but_pilot);
    }

    void from_coarse_to_fine() {
        const bool timed = budget_.kind == BudgetKind::time;
        if (!timed || !take_if_affordable(2)) {
            // A complete coarse frame is taken even if it is late.
            if (!take_centres(4, 0, FrameStep::coarse_4, timed ? PassLimit{} : limit())) return;
            if (!take_centres(2, 4, FrameStep::coarse_2)) return;
        }
        if (adaptive_ || has_indirect_)
            if (!take_centres(1, 2, has_indirect_ ? FrameStep::no_indirect : FrameStep::one_sample)) return;
        if (adaptive_ || !timed) return;
        const std::int64_t left = ns_left();
        if (left <= 0) return;
        if (costs_.known(Of::samples) && costs_.expected_ns(Of::samples, passes_.pixels()) > left)
            costs_.decay(Of::samples);
        else
            take_first_samples(limit());
    }

    /// Further samples, pass by pass.
    void refine() {
        if (adaptive_) {
            const std::int64_t start = now_ns();
            passes_.make_plan(centre_, true);
            costs_.record(Of::plan, passes_.pixels(), now_ns() - start);
            account_.standard_error = passes_.standard_error();
        }
        if (sunlight_planned_) sunlight_planned_ = mostly_separate_ && two_samples_fit();
        const std::size_t passes = separate_sunlight_ ? kSunlightPass : kMaxPasses;
        for (std::size_t i = 0; i < passes; ++i) {
            const Stage next = sunlight_planned_ ? SamplePlan::whole(wanted(i)) : wanted(i);
            const std::uint64_t samples = passes_.plan().total(next) - passes_.plan().total(stage_);
            if (samples == 0 && i == 0 && budget_.kind == BudgetKind::time && worth_a_pass())
                costs_.decay(Of::samples);
            if (samples == 0) break;
            if (to_show_ == ToShow::means) show();  // an abandoned pass invalidates the means
            const PassLimit l = limit();
            const PassCount pass = passes_.refine(sample_, stage_, next, l);
            costs_.record(Of::samples, pass.samples, pass.wall_ns);
            if (!account_for(pass, l, false)) return;
            account_.step = FrameStep::refined;
            account_.passes[i] = static_cast<std::uint32_t>(samples);
            to_show_ = ToShow::means;
            stage_ = next;
            rays_each_ = rays_each(pass);
        }
        if (sunlight_planned_ && SamplePlan::reaches(stage_, 2)) refine_sunlight();
    }

    /// Spends what the uniform passes have left of the budget.
    void refine_sunlight() {
        const std::uint32_t each = SamplePlan::samples_of(stage_);
        const SamplePlan& plan = passes_.sunlight_plan();
        const Stage to = plan.reach_beyond(each, sunlight_samples());
        const std::uint64_t samples = plan.total_beyond(each, to);
        if (samples == 0) return;
        if (to_show_ == ToShow::means) show();
        const PassLimit l = limit();
        const PassCount pass = passes_.refine_sunlight(sample_, each, to, l);
        costs_.record(Of::sunlight, pass.samples, pass.wall_ns);
        if (!account_for(pass, l, false)) return;
        account_.passes[kSunlightPass] = static_cast<std::uint32_t>(samples);
        to_show_ = ToShow::means;
    }
    [[nodiscard]] double sunlight_samples() const {
        if (budget_.kind == BudgetKind::passes) return budget_.passes[kSunlightPass];
        if (budget_.kind == BudgetKind::rays)
            return std::min(static_cast<double>(rays_left()) / kMaxRaysOfSunlight, kMaxSamples);
        return std::min(kSunlightPassTime * static_cast<double>(costs_.fitting(Of::sunlight, ns_left())),
                        kMaxSamples);
    }

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
            return recorded_step() == FrameStep::refined ? plan.reach(stage_, budget_.passes[pass]) : stage_;
        if (budget_.kind == BudgetKind::rays) {
            const double left = static_cast<double>(rays_left()) - for_sunlight(static_cast<double>(budget_.rays));
            if (left < kMinRemainder * static_cast<double>(budget_.rays)) return stage_;
            const double part = adaptive_ ? kNextPassRays : pass == 0 ? kFirstPassRays : kNextPassRaysOfPaths;
            return plan.reach(stage_, std::min(part * left, kMaxSamples), rays_each_.sample, rays_each_.path);
        }
        if (!worth_a_pass()) return stage_;
        const auto fitting = static_cast<double>(costs_.fitting(Of::samples, ns_for_samples()));
        return plan.reach(
            stage_, std::min(std::floor((pass == 0 ? kFirstPassTime : kNextPassTime) * fitting), kMaxSamples));
    }
    [[nodiscard]] bool worth_a_pass() const {
        return static_cast<double>(ns_for_samples()) >= kMinRemainder * static_cast<double>(time_given());
    }
    [[nodiscard]] std::int64_t ns_for_samples() const {
        return ns_left() - static_cast<std::int64_t>(for_sunlight(static_cast<double>(time_given())));
    }
    /// The part of the budget reserved for sunlight samples.
    [[nodiscard]] double for_sunlight(double budget) const {
        return sunlight_planned_ ? kSunlightPart * budget : 0;
    }

    /// Planning cannot be interrupted, so it is begun only if time is left for samples.
    [[nodiscard]] bool worth_planning() const {
        if (budget_.kind != BudgetKind::time) return true;
        const auto rest = static_cast<std::int64_t>(2 * kMinRemainder * static_cast<double>(time_given()));
        return costs_.expected_ns(Of::plan, passes_.pixels()) + rest <= ns_left();
    }

    void show() {
        const std::int64_t start = now_ns();
        if (to_show_ == ToShow::nothing) return;
        if (to_show_ == ToShow::centres) passes_.show_centres(centre_, stride_, out_);
        if (to_show_ == ToShow::means) {
            passes_.show_means(sample_, stage_, out_, variance_);
            account_.standard_error = passes_.standard_error();
        }
        to_show_ = ToShow::nothing;
        costs_.record(Of::show, out_.pixels.size(), now_ns() - start);
    }

    FramePasses& passes_;
    PassCosts& costs_;
    const FrameBudget budget_;
    const std::int64_t start_ns_, slack_ns_;
    const FrameSettings centre_settings_, sample_settings_;
    const Frame centre_, sample_;
    const bool has_indirect_, adaptive_, separate_sunlight_;
    RadianceImage& out_;
    std::vector<float>* const variance_;

    FrameAccount account_;
    const Frame* frame_ = nullptr;  ///< the frame whose tiles and G-buffer the passes hold
    std::uint64_t rays_ = 0;        ///< charged to the budget
    RaysEach rays_each_;            ///< of the last pass of samples
    bool sunlight_planned_ = false, mostly_separate_ = false;
    ToShow to_show_ = ToShow::nothing;
    int stride_ = 1;  ///< of the centres
    Stage stage_ = SamplePlan::none();
};

}  // namespace

FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const CameraPose& pose,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance) {
    return BudgetFrame(passes, costs, render_scene, camera, at, pose, settings, out, variance).make();
}

}  // namespace narpa
