#include "renderer/film/budgeted_frame.h"

#include <algorithm>
#include <limits>

namespace narpa {
namespace {

using Kind = FrameBudget::Kind;
using Of = PassCosts::Of;

/// Textures are averaged over the beam that a sample has where a pixel gets so many. Middles are a frame of two, so
/// that each takes a point of its own of the lens and of the Sun and shows what these blur.
constexpr int kMiddleBeam = 2, kBeamSamples = 4;
/// What waking the threads and a preempted one may take: so long, or this part of the budget if that is more.
constexpr std::int64_t kLeastSlack_ns = 300'000;
constexpr std::int64_t kSlackPart = 40;
/// By this a cost is believed to be less in each frame that did without, so that one bad measure does not last.
constexpr double kDoubt = 0.95, kLeastBelieved = 0.25;
/// Passes of fewer samples tell of their start and end alone: no more than a bound.
constexpr std::uint64_t kLeastPieces = 1000;
/// Parts of what is left that go to the first pass after the middles, so that there soon is something to show, and
/// to each of the next.
constexpr double kFirstPart = 1.0 / 3, kNextPart = 0.85;
/// Of rays, whose number follows from that of the samples nearly to the last; where paths are followed, to a tenth
/// from one pass to the next.
constexpr double kFirstRays = 0.6, kNextRaysOfPaths = 0.9, kNextRays = 0.96;
/// Of rays, so much may be expected to go to the middles: how many they take is told by a part of them.
constexpr double kSure = 0.85;
/// The coarsest image takes two rays for one pixel in 4 x 4, and for those that stand at the edges.
constexpr std::uint64_t kPixelsOfACoarseRay = 4;
/// Less than this part of the budget is not worth another pass.
constexpr double kRest = 0.05;

class BudgetFrame {
public:
    BudgetFrame(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene, const Camera& camera,
                const BodyPoses& at, const Rigid3& T_world_camera, const FrameSettings& settings,
                RadianceImage& out, std::vector<float>* variance)
        : passes_(passes),
          costs_(costs),
          budget_(settings.budget),
          begun_ns_(now_ns()),
          slack_ns_(std::max(kLeastSlack_ns, (budget_.deadline_ns - begun_ns_) / kSlackPart)),
          middle_settings_(with_spp(settings, kMiddleBeam)),
          direct_settings_(by_direct_light(middle_settings_)),
          sample_settings_(with_spp(settings, kBeamSamples)),
          middle_(make_frame(render_scene, at, camera, T_world_camera, middle_settings_)),
          direct_(make_frame(render_scene, at, camera, T_world_camera, direct_settings_)),
          sample_(make_frame(render_scene, at, camera, T_world_camera, sample_settings_)),
          has_indirect_(settings.method == RenderSettings::Method::path),
          out_(out),
          variance_(variance) {}

    FrameAccount make() {
        account_.step = FrameStep::nothing;
        begin(middle_);
        take_middles();
        if (account_.step == FrameStep::nothing) {  // nor is what told how dear it is part of an image
            account_.rays_discarded += account_.rays;
            account_.rays = account_.samples = 0;
        }
        if (passes_.pixels() == 0 && account_.step == FrameStep::one_sample)
            account_.standard_error = 0;  // nothing in view
        else if (account_.step == FrameStep::one_sample && worth_planning())
            refine();
        show();
        account_.phase_ns = passes_.times();
        return account_;
    }

private:
    enum class ToShow : std::uint8_t { nothing, middles, means };

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
    }

    // What is left.
    [[nodiscard]] std::uint64_t rays_left() const { return budget_.rays - std::min(budget_.rays, rays_); }
    [[nodiscard]] std::int64_t time_given() const { return budget_.deadline_ns - begun_ns_; }
    [[nodiscard]] std::int64_t ns_left() const {
        return budget_.deadline_ns - slack_ns_ - costs_.expected_ns(Of::show, out_.pixels.size()) - now_ns();
    }
    [[nodiscard]] PassLimit limit() const {
        PassLimit l;
        if (budget_.kind == Kind::rays) l.rays = rays_left();
        if (budget_.kind == Kind::time) l.until_ns = now_ns() + ns_left();
        return l;
    }

    /// Books a pass, and whether it counts. `instead`: what came before serves no more.
    bool book(const PassCount& pass, const PassLimit& l, bool instead) {
        if (!pass.complete) {
            // Where the threads were when they gave up must not decide what comes next.
            const std::uint64_t lost = budget_.kind == Kind::rays ? l.rays : pass.rays;
            rays_ += lost;
            account_.rays_discarded += lost;
            return false;
        }
        if (instead) {
            account_.rays_discarded += account_.rays;
            account_.rays = account_.samples = path_rays_ = 0;
        }
        rays_ += pass.rays;
        path_rays_ += pass.path_rays;
        account_.rays += pass.rays;
        account_.samples += pass.samples;
        return true;
    }

    bool take(const Frame& f, int stride, int made, FrameStep step, const PassLimit& l) {
        if (frame_ != &f) {
            show();  // other tiles, other looks
            begin(f);
        }
        const PassCount pass = passes_.middles(f, stride, made, l);
        // One pixel in 4 x 4 fills a quarter of a packet, and tells nothing of the others' cost.
        if (stride < 4 || !costs_.known(cost_of(f))) costs_.note(cost_of(f), pass.samples, pass.wall_ns);
        if (!book(pass, l, made == 0)) return false;
        account_.step = step;
        to_show_ = ToShow::middles;
        stride_ = stride;
        return true;
    }
    bool take(const Frame& f, int stride, int made, FrameStep step) { return take(f, stride, made, step, limit()); }
    [[nodiscard]] Of cost_of(const Frame& f) const {
        return f.settings.method == RenderSettings::Method::direct ? Of::direct_middles : Of::middles;
    }

    void take_middles() {
        switch (budget_.kind) {
            case Kind::samples: break;
            case Kind::passes: take_as_told(); break;
            case Kind::time:
                if (!take_first(middle_, 1, FrameStep::one_sample)) from_coarse_to_fine();
                break;
            case Kind::rays:
                if (middle_.quick && 2 * passes_.pixels() <= rays_left())  // the camera's and the Sun's
                    take(middle_, 1, 0, FrameStep::one_sample);
                else if (middle_.quick || !begin_with_a_sixteenth())
                    from_coarse_to_fine();
                break;
        }
    }
    /// A pass from which all pixels get something, where it is expected to take no more than half of the time left;
    /// should it take much more, some of that is kept for a coarser one.
    bool take_first(const Frame& f, int stride, FrameStep step) {
        const auto pieces = passes_.pixels() / static_cast<std::uint64_t>(stride * stride);
        const std::int64_t left = ns_left();
        if (!costs_.known(cost_of(f)) || costs_.expected_ns(cost_of(f), pieces) > left / 2) return false;
        PassLimit most = limit();
        most.until_ns -= left / 4;
        return take(f, stride, 0, step, most);
    }

    [[nodiscard]] FrameStep step_told() const { return static_cast<FrameStep>(budget_.step); }
    void take_as_told() {
        switch (step_told()) {
            case FrameStep::refined:
            case FrameStep::one_sample: take(middle_, 1, 0, FrameStep::one_sample); break;
            case FrameStep::no_indirect: take(direct_, 1, 0, FrameStep::no_indirect); break;
            case FrameStep::coarse_2: take(direct_, 2, 0, FrameStep::coarse_2); break;
            case FrameStep::coarse_4: take(direct_, 4, 0, FrameStep::coarse_4); break;
            case FrameStep::nothing: break;
        }
    }

    /// How many rays a sample takes is not known before: a sixteenth of the tiles tells, and the others follow if
    /// they are as good as sure to fit. Should they not, enough is kept for a coarse image.
    bool begin_with_a_sixteenth() {
        using Tiles = FramePasses::Tiles;
        if (passes_.pixels() > rays_left()) return false;
        PassLimit part = limit();
        part.rays /= 2;
        const PassCount pilot = passes_.middles(middle_, 1, 0, part, Tiles::a_sixteenth);
        if (!book(pilot, part, true)) return false;
        PassLimit rest = limit();
        rest.rays -= std::min(rest.rays, passes_.pixels() / kPixelsOfACoarseRay);
        const double each =
            static_cast<double>(pilot.rays) / static_cast<double>(std::max<std::uint64_t>(pilot.samples, 1));
        if (each * static_cast<double>(passes_.pixels() - pilot.samples) > kSure * static_cast<double>(rest.rays))
            return false;
        const PassCount others = passes_.middles(middle_, 1, 0, rest, Tiles::the_others);
        if (!book(others, rest, false)) return false;
        account_.step = FrameStep::one_sample;
        to_show_ = ToShow::middles;
        stride_ = 1;
        return true;
    }

    void from_coarse_to_fine() {
        const Frame& f = has_indirect_ ? direct_ : middle_;
        const FrameStep full = has_indirect_ ? FrameStep::no_indirect : FrameStep::one_sample;
        const bool timed = budget_.kind == Kind::time;
        if (!timed || !take_first(f, 2, FrameStep::coarse_2)) {
            // Whatever the time, there is to be a whole frame: rather late than in part.
            if (!take(f, 4, 0, FrameStep::coarse_4, timed ? PassLimit{} : limit())) return;
            if (!take(f, 2, 4, FrameStep::coarse_2)) return;
        }
        if (!take(f, 1, 2, full)) return;
        if (!has_indirect_ || !timed) return;
        const std::int64_t left = ns_left();
        if (left <= 0) return;
        if (costs_.known(Of::middles) && costs_.expected_ns(Of::middles, passes_.pixels()) > left)
            costs_.doubt(Of::middles);
        else
            take(middle_, 1, 0, FrameStep::one_sample);
    }

    /// Samples where the middles say so.
    void refine() {
        const std::int64_t start = now_ns();
        passes_.make_plan(middle_);
        costs_.note(Of::plan, passes_.pixels(), now_ns() - start);
        account_.standard_error = passes_.standard_error();
        const SamplePlan& plan = passes_.plan();
        SamplePlan::Stage stage;
        // Middles that met nothing took one ray; samples go elsewhere.
        const std::uint64_t met = std::min(std::max<std::uint64_t>(plan.met(), 1), account_.samples);
        RaysEach each{2, 0};
        if (!middle_.quick)
            each = {static_cast<double>(account_.rays - path_rays_ - (account_.samples - met)) /
                        static_cast<double>(met),
                    static_cast<double>(path_rays_) / static_cast<double>(met)};
        for (std::size_t i = 0; i < kMaxPasses; ++i) {
            const SamplePlan::Stage next = wanted(i, stage, each);
            const std::uint64_t samples = plan.total(next) - plan.total(stage);
            if (samples == 0 && i == 0 && budget_.kind == Kind::time && worth_a_pass()) costs_.doubt(Of::samples);
            if (samples == 0) return;
            if (i > 0) show();  // what the next pass adds to
            const PassLimit l = limit();
            const PassCount pass = passes_.refine(sample_, stage, next, l);
            costs_.note(Of::samples, pass.samples, pass.wall_ns);
            if (!book(pass, l, false)) return;
            account_.step = FrameStep::refined;
            account_.passes[i] = static_cast<std::uint32_t>(samples);
            to_show_ = ToShow::means;
            stage = next;
            each.sample = static_cast<double>(pass.rays - pass.path_rays) / static_cast<double>(samples);
            if (pass.paths > 0) each.path = static_cast<double>(pass.path_rays) / static_cast<double>(pass.paths);
        }
    }

    struct RaysEach {
        double sample, path;
    };
    /// Where the next pass shall lead; as far as the last: there is none.
    [[nodiscard]] SamplePlan::Stage wanted(std::size_t pass, SamplePlan::Stage from, const RaysEach& each) const {
        constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();  // what the account can hold
        const SamplePlan& plan = passes_.plan();
        if (budget_.kind == Kind::passes)
            return step_told() == FrameStep::refined ? plan.reach(from, budget_.passes[pass]) : from;
        if (budget_.kind == Kind::rays) {
            const auto left = static_cast<double>(rays_left());
            if (left < kRest * static_cast<double>(budget_.rays)) return from;
            const double part = middle_.quick ? kNextRays : pass == 0 ? kFirstRays : kNextRaysOfPaths;
            return plan.reach(from, std::min(part * left, static_cast<double>(kMost)), each.sample, each.path);
        }
        if (!worth_a_pass()) return from;
        const auto fitting = static_cast<double>(costs_.fitting(Of::samples, ns_left()));
        return plan.reach(
            from, std::min(static_cast<std::uint64_t>((pass == 0 ? kFirstPart : kNextPart) * fitting), kMost));
    }
    [[nodiscard]] bool worth_a_pass() const {
        return static_cast<double>(ns_left()) >= kRest * static_cast<double>(time_given());
    }

    /// A plan is made to its end, whatever the time: it is begun only where it leaves some for samples.
    [[nodiscard]] bool worth_planning() const {
        if (budget_.kind != Kind::time) return true;
        const auto rest = static_cast<std::int64_t>(2 * kRest * static_cast<double>(time_given()));
        return costs_.expected_ns(Of::plan, passes_.pixels()) + rest <= ns_left();
    }

    void show() {
        const std::int64_t start = now_ns();
        if (to_show_ == ToShow::nothing) return;
        if (to_show_ == ToShow::middles) passes_.show_middles(*frame_, stride_, out_);
        if (to_show_ == ToShow::means) {
            passes_.show_means(sample_, out_, variance_);
            account_.standard_error = passes_.standard_error();
        }
        to_show_ = ToShow::nothing;
        costs_.note(Of::show, out_.pixels.size(), now_ns() - start);
    }

    FramePasses& passes_;
    PassCosts& costs_;
    const FrameBudget budget_;
    const std::int64_t begun_ns_, slack_ns_;
    const FrameSettings middle_settings_, direct_settings_, sample_settings_;
    const Frame middle_, direct_, sample_;
    const bool has_indirect_;
    RadianceImage& out_;
    std::vector<float>* const variance_;

    FrameAccount account_;
    const Frame* frame_ = nullptr;  ///< whose middles are taken
    std::uint64_t rays_ = 0;        ///< that the budget is charged
    std::uint64_t path_rays_ = 0;   ///< of those that the account has
    ToShow to_show_ = ToShow::nothing;
    int stride_ = 1;
};

}  // namespace

void PassCosts::note(Of what, std::uint64_t pieces, std::int64_t wall_ns) noexcept {
    if (pieces == 0) return;
    double& ns = ns_[index(what)];
    const double now = static_cast<double>(wall_ns) / static_cast<double>(pieces);
    if (pieces < kLeastPieces && !(known(what) && now < ns)) return;
    // A frame that something held up tells little of the next.
    switch (measures_[index(what)]) {
        case 0: ns = now; break;
        case 1: ns = std::min(ns, now); break;
        default: ns += 0.3 * (std::clamp(now, 0.5 * ns, 2 * ns) - ns);
    }
    if (measures_[index(what)] < 2) ++measures_[index(what)];
    least_ns_[index(what)] = kLeastBelieved * ns;
}

void PassCosts::doubt(Of what) noexcept {
    ns_[index(what)] = std::max(kDoubt * ns_[index(what)], least_ns_[index(what)]);
}

std::uint64_t PassCosts::fitting(Of what, std::int64_t wall_ns) const noexcept {
    return static_cast<std::uint64_t>(static_cast<double>(std::max<std::int64_t>(wall_ns, 0)) / ns_[index(what)]);
}

FrameAccount render_within_budget(FramePasses& passes, PassCosts& costs, const RenderScene& render_scene,
                                  const Camera& camera, const BodyPoses& at, const Rigid3& T_world_camera,
                                  const FrameSettings& settings, RadianceImage& out, std::vector<float>* variance) {
    return BudgetFrame(passes, costs, render_scene, camera, at, T_world_camera, settings, out, variance).make();
}

}  // namespace narpa
