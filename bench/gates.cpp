#include "bench/gates.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "base/time.h"
#include "bench/budget_ladder.h"
#include "renderer/camera/detector.h"

namespace narpa {
namespace {

/// A camera that makes frame after frame of one view: direct light, one sample a pixel.
class Maker {
public:
    Maker(const World& world, std::size_t index, TracingThreads& threads)
        : camera_(world.scene().cameras[index]),
          threads_(threads),
          at(world.scene().bodies.size()),
          renderer_(world.render_scene(), camera_),
          image_(camera_.width, camera_.height),
          bytes_(frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns})),
          handed_(bytes_.size()) {
        world.place(0, camera_.mount, at);
        T_world_camera = world.sensor_pose(camera_.mount, camera_.T_mount_camera, at);
        settings_.seed = world.scene().render.seed;
        make();  // takes the memory
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

private:
    const Camera& camera_;
    TracingThreads& threads_;

public:
    BodyPoses at;
    Rigid3 T_world_camera;

private:
    CameraRenderer renderer_;
    RadianceImage image_;
    std::vector<std::uint8_t> bytes_, handed_;
    FrameSettings settings_{};
};

}  // namespace

Result<FrameCost> frame_against_raw(const World& world, std::size_t index, int rounds, TracingThreads& threads) {
    Maker maker(world, index, threads);
    auto raw = threads.arena.execute([&] { return RawEmbree::create(world.scene(), maker.at); });
    if (!raw) return raw.error();
    const Vec3 to_sun = world.scene().sun ? normalized(world.scene().sun->direction) : Vec3{0, 0, 1};
    const auto trace = [&] {
        return threads.arena.execute([&] { return raw->trace(maker.camera(), maker.T_world_camera, to_sun); });
    };
    trace();
    std::vector<double> frame, radiance, detector, hand_over, primary, shadow;
    FrameCost cost;
    for (int k = 0; k < rounds; ++k) {
        const Maker::Times t = maker.make();
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

std::vector<double> frames_of(const World& world, std::span<const std::size_t> cameras, int rounds,
                              TracingThreads& threads) {
    std::vector<std::unique_ptr<Maker>> makers;
    for (const std::size_t camera : cameras) makers.push_back(std::make_unique<Maker>(world, camera, threads));
    std::vector<std::vector<double>> seconds(cameras.size());
    for (int round = 0; round < rounds; ++round)
        for (std::size_t k = 0; k < cameras.size(); ++k) seconds[k].push_back(makers[k]->make().frame_s());
    std::vector<double> medians;
    for (const std::vector<double>& of_camera : seconds) medians.push_back(median(of_camera));
    return medians;
}

TwoFrames still_and_moved(const World& world, std::size_t camera, int rounds, TracingThreads& threads) {
    Maker maker(world, camera, threads);
    const BodyPoses still = maker.at;
    std::vector<double> still_s, moved_s;
    for (int k = 0; k < rounds; ++k) {
        maker.at = still;
        maker.make();  // so that the next finds nothing moved
        still_s.push_back(maker.make().frame_s());
        const std::int64_t start_ns = monotonic_ns();
        for (std::size_t b = 0; b < still.T_world_body.size(); ++b)
            maker.at.set(b, still.T_world_body[b] * Rigid3{exp_rotation({0, 0, 1e-5}), {1e-4, 0, 0}});
        const double set_s = seconds_since(start_ns);
        moved_s.push_back(set_s + maker.make().frame_s());
    }
    return {median(still_s), median(moved_s)};
}

Result<double> load_to_first_frame(const std::function<Result<Scene>()>& load, std::size_t camera, int rounds,
                                   TracingThreads& threads) {
    std::vector<double> seconds;
    for (int k = 0; k < rounds; ++k) {
        const std::int64_t start_ns = monotonic_ns();
        auto scene = load();
        if (!scene) return scene.error();
        auto world = World::create(*std::move(scene));
        if (!world) return world.error();
        const Maker maker(**world, camera, threads);
        seconds.push_back(seconds_since(start_ns));
    }
    return median(seconds);
}

namespace {

/// None: no fault.
std::optional<std::string> prediction_fault(const Rung& rung) {
    if (rung.rmse.value <= 0)
        return "its error does not stand out from the reference's noise: take a better reference";
    if (!rung.predicted)
        return rung.estimates_error() ? std::optional<std::string>("its frames have no error estimate")
                                      : std::nullopt;
    if (rung.predicted_to_measured() >= kPredictedLeast && rung.predicted_to_measured() <= kPredictedMost)
        return {};
    return fmt::format("the predicted error is {:.2f} of the measured, expected {} to {}",
                       rung.predicted_to_measured(), kPredictedLeast, kPredictedMost);
}

std::optional<std::string> speed_fault(const SceneLadder& scene) {
    if (scene.speed_up_least <= 0) return {};
    constexpr double kUsed = 0.9;  // a budget is not used up to the last ray
    const double rays_least = kUsed * scene.speed_up_from * scene.width * scene.height;
    const auto s = speed_ups(scene.ladder, true, TimeBy::wall, rays_least);
    if (!s) return "no budget's error lies between those of the plain loop";
    if (s->median >= scene.speed_up_least) return {};
    return fmt::format(
        "{:.2f} times as fast as the plain loop at equal error{}, expected {:g} or more", s->median,
        scene.speed_up_from > 0 ? fmt::format(" from {:g} rays a pixel on", scene.speed_up_from) : "",
        scene.speed_up_least);
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
    at_most("a frame to Embree's calls on its rays", r.cost.to_raw(), kToRawMost, "");
    at_most("1 % cover to full cover", r.space.edge_s / r.space.filled_s, kEdgeMost, "");
    at_most("what a moved body costs", 1e3 * (r.still_and_moved.second_s - r.still_and_moved.first_s),
            1e3 * kMovedMost_s, " ms");
    at_most("load to first frame", r.load_s, kLoadMost_s, " s");
    return faults;
}

}  // namespace narpa
