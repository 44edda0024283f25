#include "tracking/single_estimate.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>
#include <utility>

#include "emulator/camera/camera_control.h"
#include "estimator/cloud/own_body.h"
#include "estimator/search/cloud_search.h"
#include "estimator/uncertainty/observed_error.h"
#include "tracking/estimate_report.h"
#include "tracking/frame_tracker.h"

namespace narpa {
namespace {

nlohmann::json rows_of(const Matrix6& m) {
    std::array<std::array<double, 6>, 6> rows{};
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) rows[std::size_t(i)][std::size_t(j)] = m(i, j);
    return rows;
}

/// T_lidar_target at a time, as the world has it.
class RelativePoses {
public:
    RelativePoses(const World& world, const Lidar& lidar, std::size_t target)
        : world_(world), lidar_(lidar), target_(target), at_(world.scene().bodies.size()) {}
    [[nodiscard]] Rigid3 at(std::int64_t t_ns) {
        world_.place(t_ns, lidar_.mount, at_);
        return inverse(T_world_lidar()) * at_.T_world_body[target_];
    }
    /// At the last time.
    [[nodiscard]] Rigid3 T_world_lidar() const {
        return world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, at_);
    }

private:
    const World& world_;
    const Lidar& lidar_;
    std::size_t target_;
    BodyPoses at_;
};

IcpSettings icp_settings(const Lidar& lidar, const Scene& scene, const TrackerOptions& options) {
    IcpSettings settings;
    settings.model = options.model;
    settings.noise = range_noise_of(lidar);
    settings.certain = certain_return_of(lidar, scene);
    if (options.range_noise_m > 0) settings.noise.range_m = options.range_noise_m;
    return settings;
}

}  // namespace

nlohmann::json pose_document(const EstimatedPose& of, const Rigid3& T, const Matrix6& covariance,
                             const Matrix6& bound, const Answer& answer) {
    nlohmann::json document{{"passed", answer.usable()},
                            {"target", of.target},
                            {of.sensor_kind, of.sensor},
                            {"answer", to_json(answer)},
                            {"pose", to_json(T)},
                            {"pose_in_world", to_json(of.T_world_sensor * T)},
                            {"covariance", rows_of(covariance)},
                            {"bound", rows_of(bound)},
                            {"bound_rotation_rad", rotation_sigma(bound)},
                            {"bound_position_m", position_sigma(bound)},
                            {of.known_is_guess ? "guess" : "truth", to_json(of.known)}};
    if (of.known_is_guess) return document;
    const Vector6 error = error_between(T, of.known);
    const ObservedError nees = observed_error(T, covariance, answer, of.known);
    document["error_rotation_rad"] = error.head<3>().norm(), document["error_position_m"] = error.tail<3>().norm();
    document["nees"] = std::isfinite(nees.squared) ? nlohmann::json(nees.squared) : nlohmann::json(nullptr);
    document["nees_expected"] = nees.freedom;
    return document;
}

FrameLedger nominal_ledger(const Camera& camera, std::int64_t t_ns) {
    FrameLedger taken;
    taken.t_exposure_mid_ns = t_ns;
    taken.t_exposure_start_ns = t_ns - exposure_ns(camera) / 2;
    taken.t_exposure_end_ns = taken.t_exposure_start_ns + exposure_ns(camera);
    taken.region_width = static_cast<std::uint16_t>(camera.width);
    taken.region_height = static_cast<std::uint16_t>(camera.height);
    return taken;
}

Result<FrameEstimate> estimate_one_frame(const World& world,
                                         const SingleMeasurement<std::span<const std::uint8_t>>& frame,
                                         TrackerOptions options) {
    const Scene& scene = world.scene();
    const Camera& camera = scene.cameras[frame.sensor];
    const auto target = target_of(world, camera.mount, camera.name, options.target);
    if (!target) return target.error();
    BodyPoses at(scene.bodies.size());
    world.place(frame.t_ns, camera.mount, at);
    const Rigid3 T_world_camera = world.camera_pose(camera, 1e-9 * static_cast<double>(frame.t_ns), at);
    if (frame.guess) at.set(*target, T_world_camera * *frame.guess);
    if (frame.world_is_guess) options.guess = inverse(T_world_camera) * at.T_world_body[*target];
    if (frame.guess) options.guess = frame.guess;

    TrackedFrame tracked;
    const auto take = [&]() -> Status {
        const auto tracker = FrameTracker::create(world, frame.sensor, options);
        if (!tracker) return tracker.error();
        const int renders = tracked.renders;
        tracked = (*tracker)->take(nominal_ledger(camera, frame.t_ns), frame.measured, at);
        tracked.renders += renders;
        return Ok{};
    };
    if (auto taken = take(); !taken) return taken.error();
    if (options.guess && tracked.measured && !options.search && options.method->light_is_that_of_the_guess) {
        // Repeats with the illumination at the estimated attitude.
        at.set(*target, T_world_camera * *tracked.measured);
        if (auto taken = take(); !taken) return taken.error();
    }
    EstimatedPose of{
        scene.bodies[*target].name, camera.name, "camera", T_world_camera, options.guess.value_or(tracked.truth),
        options.guess.has_value()};
    return FrameEstimate{std::move(of), std::move(tracked)};
}

nlohmann::json document(const FrameEstimate& estimate) {
    const TrackedFrame& t = estimate.tracked;
    if (!t.measured) return {{"passed", false}, {"answer", to_json(t.answer)}};
    nlohmann::json document = pose_document(estimate.of, *t.measured, t.covariance, t.bound, t.answer);
    document["matches"] = t.matches;
    document["renders"] = t.renders;
    return document;
}

bool SweepEstimate::has_pose() const noexcept {
    return cloud.used >= kFewestSweepPoints;
}

Result<SweepEstimate> estimate_one_sweep(const World& world, SingleMeasurement<LidarSweep> sweep,
                                         const TrackerOptions& options) {
    const Scene& scene = world.scene();
    const Lidar& lidar = scene.lidars[sweep.sensor];
    const auto target = target_of(world, lidar.mount, lidar.name, options.target);
    if (!target) return target.error();
    LidarSweep& points = sweep.measured;
    remove_own_body(world.tracer(), lidar, points);
    RelativePoses poses(world, lidar, *target);
    const Rigid3 later = poses.at(sweep.t_ns + kSweepMotion_ns), in_world = poses.at(sweep.t_ns);
    const ApparentMotion motion = motion_between(in_world, later, kSweepMotion_ns * 1e-9);
    const bool known_is_guess = sweep.world_is_guess || sweep.guess;
    const Rigid3 known = sweep.guess.value_or(in_world);
    std::mt19937_64 random(options.seed);
    const Rigid3 guess = known_is_guess ? known : displaced_truth(known, options, random);
    const double range_m = norm(known.t);
    const double search_m = 0.01 * options.start_percent * range_m +
                            options.start_deg * kDegree * world.tracer().bounding_radius_m(*target);
    const IcpSettings settings = icp_settings(lidar, scene, options);
    auto found =
        options.search
            ? CloudSearch(world.tracer(), *target, settings).find(points.points, motion, points.empty)
            : CloudIcp(world.tracer(), *target, settings)
                  .align(points.points, motion, guess, search_m, points.empty, start_covariance(options, range_m));
    if (!found) {
        Error error = found.error();
        error.kind = ErrorKind::failed;
        return error;
    }
    EstimatedPose of{scene.bodies[*target].name, lidar.name, "lidar", poses.T_world_lidar(), known, known_is_guess};
    return SweepEstimate{std::move(of), *std::move(found)};
}

nlohmann::json document(const SweepEstimate& estimate) {
    const CloudEstimate& e = estimate.cloud;
    if (!estimate.has_pose()) return {{"passed", false}, {"answer", to_json(e.answer)}};
    nlohmann::json document = pose_document(estimate.of, e.T_lidar_target, e.covariance, e.bound, e.answer);
    document["empty"] = e.empty_beams.empty;
    document["points"] = e.points;
    document["used"] = e.used;
    document["explained"] = e.explained;
    document["unobserved"] = e.observability.unobserved;
    document["iterations"] = e.iterations;
    return document;
}

}  // namespace narpa
