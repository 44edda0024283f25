#include "bench/gates.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/time.h"
#include "bench/statistics.h"
#include "renderer/detector/detector.h"

namespace narpa {
namespace {

/// Renders frame after frame of one view: direct light, one sample a pixel.
class FrameRenderer {
public:
    FrameRenderer(const World& world, std::size_t index, TracingThreads& threads)
        : at(world.scene().bodies.size()),
          camera_(world.scene().cameras[index]),
          threads_(threads),
          renderer_(world.render_scene(), camera_),
          image_(camera_.width, camera_.height),
          bytes_(frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns})),
          handed_(bytes_.size()) {
        world.place(0, camera_.mount, at);
        T_world_camera = world.camera_pose(camera_, 0, at);
        settings_.seed = world.scene().render.seed;
        make();  // allocates memory
    }
    struct Times {
        double radiance_s, detector_s, hand_over_s;
        PhaseTimes phase_ns;
        [[nodiscard]] double frame_s() const { return radiance_s + detector_s; }
    };
    Times make(bool phases = false) {
        Times t{};
        ++settings_.frame;
        settings_.times = phases;
        threads_.arena.execute([&] {
            std::int64_t start_ns = monotonic_ns();
            t.phase_ns = renderer_.render(at, T_world_camera, settings_, image_).phase_ns;
            t.radiance_s = seconds_since(start_ns);
            start_ns = monotonic_ns();
            expose(camera_, image_, settings_.seed, settings_.frame, bytes_);
            t.detector_s = seconds_since(start_ns);
        });
        const std::int64_t start_ns = monotonic_ns();
        std::copy(bytes_.begin(), bytes_.end(), handed_.begin());
        t.hand_over_s = seconds_since(start_ns);
        return t;
    }
    [[nodiscard]] const Camera& camera() const { return camera_; }

    BodyPoses at;
    Rigid3 T_world_camera;

private:
    const Camera& camera_;
    TracingThreads& threads_;
    CameraRenderer renderer_;
    RadianceImage image_;
    std::vector<std::uint8_t> bytes_, handed_;
    FrameSettings settings_{};
};

Result<FrameCost> frame_against_raw(const World& world, std::size_t index, int rounds, TracingThreads& threads) {
    FrameRenderer maker(world, index, threads);
    auto raw = threads.arena.execute([&] { return raw_embree(world.scene(), maker.at); });
    if (!raw) return raw.error();
    const Vec3 to_sun = world.scene().sun ? normalized(world.scene().sun->direction) : Vec3{0, 0, 1};
    const auto trace = [&] {
        return threads.arena.execute([&] { return (*raw)(maker.camera(), maker.T_world_camera, to_sun); });
    };
    trace();
    std::vector<double> frame, radiance, detector, hand_over, primary, shadow;
    FrameCost cost;
    for (int k = 0; k < rounds; ++k) {
        const FrameRenderer::Times t = maker.make();
        frame.push_back(t.frame_s()), radiance.push_back(t.radiance_s);
        detector.push_back(t.detector_s), hand_over.push_back(t.hand_over_s);
        cost.raw = trace();
        primary.push_back(cost.raw.primary_s), shadow.push_back(cost.raw.shadow_s);
    }
    cost.phase_ns = maker.make(true).phase_ns;
    cost.frame_s = median(frame), cost.radiance_s = median(radiance), cost.detector_s = median(detector);
    cost.hand_over_s = median(hand_over);
    cost.raw.primary_s = median(primary), cost.raw.shadow_s = median(shadow);
    return cost;
}

void measure_cover(const World& world, std::size_t far, std::size_t edge, std::size_t filled, int rounds,
                   TracingThreads& threads, CraftRatios& out) {
    FrameRenderer of_far(world, far, threads), of_edge(world, edge, threads), of_filled(world, filled, threads);
    std::vector<double> far_s, edge_s, filled_s;
    for (int k = 0; k < rounds; ++k) {
        far_s.push_back(of_far.make().radiance_s);
        edge_s.push_back(of_edge.make().radiance_s);
        filled_s.push_back(of_filled.make().radiance_s);
    }
    out.far_s = median(far_s), out.edge_s = median(edge_s), out.filled_s = median(filled_s);
}

void measure_moved(const World& world, std::size_t camera, int rounds, TracingThreads& threads, CraftRatios& out) {
    FrameRenderer maker(world, camera, threads);
    const BodyPoses still = maker.at;
    std::vector<double> still_s, moved_s;
    for (int k = 0; k < rounds; ++k) {
        maker.at = still;
        maker.make();  // so that nothing has moved at the next one
        still_s.push_back(maker.make().frame_s());
        const std::int64_t start_ns = monotonic_ns();
        for (std::size_t b = 0; b < still.T_world_body.size(); ++b)
            maker.at.set(b, still.T_world_body[b] * Rigid3{exp_rotation({0, 0, 1e-5}), {1e-4, 0, 0}});
        const double set_s = seconds_since(start_ns);
        moved_s.push_back(set_s + maker.make().frame_s());
    }
    out.still_s = median(still_s), out.moved_s = median(moved_s);
}

}  // namespace

Result<CraftRatios> measure_ratios(const std::function<Result<Scene>()>& load, int rounds, int loads,
                                   TracingThreads& threads,
                                   const std::function<void(const std::string&)>& progress) {
    auto scene = load();
    if (!scene) return scene.error();
    std::vector<std::size_t> cameras;
    for (const char* name : {"near", "far", "edge", "filled"}) {
        auto index = sensor_named(scene->cameras, name, "camera", scene->file);
        if (!index) return index.error();
        cameras.push_back(*index);
    }
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    CraftRatios r;
    progress("a frame beside Embree's calls");
    for (const auto& [camera, cost] : {std::pair{cameras[0], &r.near}, {cameras[1], &r.far}}) {
        auto measured = frame_against_raw(**world, camera, rounds, threads);
        if (!measured) return measured.error();
        *cost = *measured;
    }
    progress("empty space, moved bodies, first frames");
    measure_cover(**world, cameras[1], cameras[2], cameras[3], rounds, threads, r);
    measure_moved(**world, cameras[0], rounds, threads, r);
    std::vector<double> load_s;
    for (int k = 0; k < loads; ++k) {
        const std::int64_t start_ns = monotonic_ns();
        auto again = load();
        if (!again) return again.error();
        auto new_world = World::create(*std::move(again));
        if (!new_world) return new_world.error();
        const FrameRenderer maker(**new_world, cameras[0], threads);
        load_s.push_back(seconds_since(start_ns));
    }
    r.load_s = median(load_s);
    return r;
}

namespace {

/// None: no fault.
std::optional<std::string> prediction_fault(const Rung& rung) {
    if (rung.rmse.value <= 0)
        return "its error does not stand out from the reference's noise: take a better reference";
    if (!rung.predicted)
        return rung.estimates_error() ? std::optional<std::string>("its frames have no error estimate")
                                      : std::nullopt;
    const bool filled = is_filled(rung.step);
    const double least = filled ? kFilledPredictedLeast : kPredictedLeast;
    const double most = filled ? kFilledPredictedMost : kPredictedMost;
    if (rung.predicted_to_measured() >= least && rung.predicted_to_measured() <= most) return {};
    return fmt::format("the predicted error is {:.2f} of the measured, expected {} to {}",
                       rung.predicted_to_measured(), least, most);
}

std::optional<std::string> speed_fault(const SceneLadder& scene) {
    if (scene.speed_up_min <= 0) return {};
    constexpr double kUsed = 0.9;  // a budget is not used up to the last ray
    const double rays_min = kUsed * scene.speed_up_from * scene.width * scene.height;
    const auto s = speed_ups(scene.ladder, true, TimeBy::wall, rays_min);
    if (!s) return "no budget's error lies between those of the plain loop";
    if (s->median >= scene.speed_up_min) return {};
    return fmt::format(
        "{:.2f} times as fast as the plain loop at equal error{}, expected {:g} or more", s->median,
        scene.speed_up_from > 0 ? fmt::format(" from {:g} rays a pixel on", scene.speed_up_from) : "",
        scene.speed_up_min);
}

}  // namespace

std::vector<std::string> bench_faults(const SceneLadder& scene) {
    std::vector<std::string> faults;
    for (const Rung& rung : scene.ladder.rungs)
        if (!rung.loop)
            if (const auto fault = prediction_fault(rung))
                faults.push_back(fmt::format("{}, {}: {}", scene.scene, rung.name, *fault));
    if (const auto fault = speed_fault(scene)) faults.push_back(scene.scene + ": " + *fault);
    return faults;
}

std::vector<std::string> bench_faults(const CraftRatios& r) {
    std::vector<std::string> faults;
    const auto at_most = [&](const char* what, double value, double bound, const char* unit) {
        if (!(value <= bound))
            faults.push_back(fmt::format("{}: {:.4g}{}, expected at most {:g}{}", what, value, unit, bound, unit));
    };
    at_most("a frame to Embree's calls on its rays", r.near.to_raw(), kToRawMost, "");
    at_most("1 % cover to full cover", r.edge_s / r.filled_s, kEdgeMost, "");
    at_most("what a moved body costs", 1e3 * (r.moved_s - r.still_s), 1e3 * kMovedMost_s, " ms");
    at_most("load to first frame", r.load_s, kLoadMost_s, " s");
    return faults;
}

}  // namespace narpa
