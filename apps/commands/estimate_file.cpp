#include "apps/commands/estimate_file.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>
#include <random>

#include "apps/commands/sweep_file.h"
#include "apps/scene_argument.h"
#include "apps/warnings.h"
#include "emulator/camera/camera_control.h"
#include "emulator/threads.h"
#include "estimator/cloud/cloud_icp.h"
#include "estimator/cloud/own_body.h"
#include "estimator/search/cloud_search.h"
#include "estimator/uncertainty/observed_error.h"
#include "estimator/view/measured_image.h"
#include "renderer/camera/scene_camera.h"
#include "tracking/estimate_report.h"
#include "tracking/frame_tracker.h"

namespace narpa::cli {

Result<std::unique_ptr<World>> world_of(const FileEstimate& o, std::int64_t t_ns, std::int64_t until_ns) {
    auto scene = SceneArgument{o.scene, o.sets}.load();
    if (!scene) return scene.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = o.sweep.empty() ? World::create(*std::move(scene)) : World::create_for_lidars(*std::move(scene));
    if (!world) return world;
    if (auto loaded = o.pose.load(**world, t_ns, until_ns); !loaded) return loaded.error();
    return world;
}

nlohmann::json show(const EstimatedPose& of, const Rigid3& T, const Matrix6& covariance, const Matrix6& bound,
                    const Answer& answer) {
    const Vector6 error = error_between(T, of.known);
    const ObservedError nees = observed_error(T, covariance, answer, of.known);
    const NeesBand band = nees_band(nees.freedom);
    const Rigid3 in_world = of.T_world_sensor * T;
    say(fmt::format("{} in {} {}: position ({:.6g}, {:.6g}, {:.6g}) m, attitude ({:.7f}, {:.7f}, {:.7f}, {:.7f})",
                    of.target, of.sensor_kind, of.sensor, T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z));
    const std::string off =
        fmt::format("{:.3g} deg and {:.3g} m", error.head<3>().norm() / kDegree, error.tail<3>().norm());
    if (of.known_is_guess)
        say(fmt::format(
            "  off the guess by {}; in the world: --pose {}={:.9g},{:.9g},{:.9g},{:.9f},{:.9f},{:.9f},{:.9f}", off,
            of.target, in_world.t.x, in_world.t.y, in_world.t.z, in_world.q.w, in_world.q.x, in_world.q.y,
            in_world.q.z));
    else
        say(fmt::format("  off the truth by {}; NEES {:.2f}, {} expected, 95 % band {:g} to {:g}; {}", off,
                        nees.squared, nees.freedom, band.low, band.high,
                        nees_verdict(nees.squared, band.low, band.high)));
    say(fmt::format("  standard deviations {:.3g} deg, {:.3g} m; bound {:.3g} deg, {:.3g} m",
                    rotation_sigma(covariance) / kDegree, position_sigma(covariance),
                    rotation_sigma(bound) / kDegree, position_sigma(bound)));
    say(fmt::format("  {}{}{}", kAnswerKinds[static_cast<std::size_t>(answer.kind)], answer.why.empty() ? "" : ": ",
                    answer.why));
    std::array<std::array<double, 6>, 6> rows{};
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) rows[std::size_t(i)][std::size_t(j)] = covariance(i, j);
    nlohmann::json document{{"passed", answer.usable()},
                            {"target", of.target},
                            {of.sensor_kind, of.sensor},
                            {"answer", to_json(answer)},
                            {"pose", to_json(T)},
                            {"pose_in_world", to_json(in_world)},
                            {"covariance", rows},
                            {"bound_rotation_rad", rotation_sigma(bound)},
                            {"bound_position_m", position_sigma(bound)},
                            {of.known_is_guess ? "guess" : "truth", to_json(of.known)}};
    if (of.known_is_guess) return document;
    document["error_rotation_rad"] = error.head<3>().norm(), document["error_position_m"] = error.tail<3>().norm();
    document["nees"] = std::isfinite(nees.squared) ? nlohmann::json(nees.squared) : nlohmann::json(nullptr);
    document["nees_expected"] = nees.freedom;
    return document;
}

nlohmann::json no_pose(const std::string& file, const Answer& answer, const std::string& why) {
    say(fmt::format("{} gives no pose: {}: {}", file, kAnswerKinds[static_cast<std::size_t>(answer.kind)], why));
    return {{"passed", false}, {"answer", to_json(answer)}};
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

Result<std::vector<std::uint8_t>> frame_of(const std::string& path, const Camera& camera) {
    auto bytes = load_frame(path, camera);
    if (!bytes) return bytes;
    if (auto image = measured_image(camera, *bytes); !image) return Error{image.error().what, path};
    return bytes;
}

Outcome estimate_frame(const FileEstimate& o, TrackerOptions options) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    auto world = world_of(o, t_ns, t_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto camera = sensor_named(scene.cameras, o.sensor, "camera", scene.file);
    if (!camera) return camera.error();
    const auto target =
        target_of(**world, scene.cameras[*camera].mount, scene.cameras[*camera].name, options.target);
    if (!target) return target.error();
    const auto bytes = frame_of(o.frames.front(), scene.cameras[*camera]);
    if (!bytes) return bytes.error();
    BodyPoses at(scene.bodies.size());
    (*world)->place(t_ns, scene.cameras[*camera].mount, at);
    const Rigid3 T_world_camera = (*world)->camera_pose(scene.cameras[*camera], o.time_s, at);
    if (o.no_truth) options.guess = inverse(T_world_camera) * at.T_world_body[*target];
    TracingThreads threads(o.threads);
    TrackedFrame tracked;
    {
        const Progress progress("estimating the pose in " + o.frames.front());
        const auto take = [&] {
            const auto tracker = FrameTracker::create(**world, *camera, options);
            const int renders = tracked.renders;
            tracked = (*tracker)->take(nominal_ledger(scene.cameras[*camera], t_ns), *bytes, at);
            tracked.renders += renders;
        };
        threads.arena.execute([&] {
            take();
            if (!options.guess || !tracked.measured || options.search ||
                !options.method->light_is_that_of_the_guess)
                return;
            // Repeats with the illumination at the estimated attitude.
            at.set(*target, T_world_camera * *tracked.measured);
            take();
        });
    }
    if (!tracked.measured) return no_pose(o.frames.front(), tracked.answer, tracked.why);
    nlohmann::json document = show({scene.bodies[*target].name, scene.cameras[*camera].name, "camera",
                                    T_world_camera, options.guess.value_or(tracked.truth), o.no_truth},
                                   *tracked.measured, tracked.covariance, tracked.bound, tracked.answer);
    document["matches"] = tracked.matches;
    document["renders"] = tracked.renders;
    return document;
}

Outcome estimate_sweep(const FileEstimate& o, const TrackerOptions& tracker) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    constexpr std::int64_t kLater_ns = 10'000'000;
    auto world = world_of(o, t_ns, t_ns + kLater_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto index = sensor_named(scene.lidars, o.sensor, "LiDAR", scene.file);
    if (!index) return index.error();
    const Lidar& lidar = scene.lidars[*index];
    auto target = target_of(**world, lidar.mount, lidar.name, tracker.target);
    if (!target) return target.error();
    auto captured = read_sweep(o.sweep, *lidar.model, o.unit);
    if (!captured) return captured.error();
    for (const std::string& warning : captured->warnings) warn(warning);
    LidarSweep& sweep = captured->sweep;
    BodyPoses then(scene.bodies.size());
    (*world)->place(t_ns, lidar.mount, then);
    remove_own_body((*world)->tracer(), lidar, sweep);
    const auto T_lidar_target_at = [&](std::int64_t t) {
        BodyPoses at(scene.bodies.size());
        (*world)->place(t, lidar.mount, at);
        return inverse((*world)->sensor_pose(lidar.mount, lidar.T_mount_lidar, at)) * at.T_world_body[*target];
    };
    const Rigid3 truth = T_lidar_target_at(t_ns);  // or the guess
    const Rigid3 T_world_lidar = (*world)->sensor_pose(lidar.mount, lidar.T_mount_lidar, then);
    const ApparentMotion motion = motion_between(truth, T_lidar_target_at(t_ns + kLater_ns), kLater_ns * 1e-9);
    std::mt19937_64 random(tracker.seed);
    const Rigid3 guess = o.no_truth ? truth : displaced_truth(truth, tracker, random);
    const double search_m = 0.01 * tracker.start_percent * norm(truth.t) +
                            tracker.start_deg * kDegree * (*world)->tracer().bounding_radius_m(*target);
    IcpSettings settings;
    settings.model = tracker.model;
    settings.noise = range_noise_of(lidar);
    settings.certain = certain_return_of(lidar, scene);
    if (tracker.range_noise_m > 0) settings.noise.range_m = tracker.range_noise_m;
    TracingThreads threads(o.threads);
    std::optional<Result<CloudEstimate>> found;
    {
        const Progress progress("estimating the pose in " + o.sweep);
        const auto estimate = [&] {
            const Tracer& tracer = (*world)->tracer();
            return tracker.search ? CloudSearch(tracer, *target, settings).find(sweep.points, motion, sweep.empty)
                                  : CloudIcp(tracer, *target, settings)
                                        .align(sweep.points, motion, guess, search_m, sweep.empty,
                                               start_covariance(tracker, norm(truth.t)));
        };
        threads.arena.execute([&] { found.emplace(estimate()); });
    }
    if (!*found) return Error{found->error().what, o.sweep, 0, 0, ErrorKind::failed};
    const CloudEstimate& e = **found;
    if (e.used < kFewestSweepPoints) return no_pose(o.sweep, e.answer, e.answer.why);
    nlohmann::json document =
        show({scene.bodies[*target].name, lidar.name, "lidar", T_world_lidar, truth, o.no_truth}, e.T_lidar_target,
             e.covariance, e.bound, e.answer);
    const int unobserved = e.observability.unobserved;
    say(
        fmt::format("  {} returns (its own body's left out), {} used, {} as the model has them; {} motions that "
                    "cannot be seen; {} iterations",
                    e.points, e.used, e.explained, unobserved, e.iterations));
    document["capture"] = to_json(*captured);
    document["empty"] = e.empty_beams.empty;
    document["points"] = e.points;
    document["used"] = e.used;
    document["explained"] = e.explained;
    document["unobserved"] = unobserved;
    document["iterations"] = e.iterations;
    return document;
}
}  // namespace narpa::cli
