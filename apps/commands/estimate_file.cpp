#include "apps/commands/estimate_file.h"

#include <fmt/format.h>

#include <cmath>

#include "apps/commands/sweep_file.h"
#include "apps/scene_argument.h"
#include "apps/warnings.h"
#include "emulator/threads.h"
#include "estimator/uncertainty/observed_error.h"
#include "estimator/view/measured_image.h"
#include "tracking/estimate_report.h"

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
    return pose_document(of, T, covariance, bound, answer);
}

nlohmann::json no_pose(const std::string& file, const Answer& answer, const std::string& why) {
    say(fmt::format("{} gives no pose: {}: {}", file, kAnswerKinds[static_cast<std::size_t>(answer.kind)], why));
    return {{"passed", false}, {"answer", to_json(answer)}};
}

Result<std::vector<std::uint8_t>> frame_of(const std::string& path, const Camera& camera) {
    auto bytes = load_frame(path, camera);
    if (!bytes) return bytes;
    if (auto image = measured_image(camera, *bytes); !image) return Error{image.error().what, path};
    return bytes;
}

Outcome estimate_frame(const FileEstimate& o, const TrackerOptions& options) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    auto world = world_of(o, t_ns, t_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto camera = sensor_named(scene.cameras, o.sensor, "camera", scene.file);
    if (!camera) return camera.error();
    const Camera& c = scene.cameras[*camera];
    if (auto target = target_of(**world, c.mount, c.name, options.target); !target) return target.error();
    const auto bytes = frame_of(o.frames.front(), c);
    if (!bytes) return bytes.error();
    TracingThreads threads(o.threads);
    const auto found = [&] {
        const Progress progress("estimating the pose in " + o.frames.front());
        return threads.arena.execute([&] {
            return estimate_one_frame(**world, {*camera, t_ns, *bytes, o.no_truth}, options);
        });
    }();
    if (!found) return found.error();
    const TrackedFrame& tracked = found->tracked;
    if (!tracked.measured) return no_pose(o.frames.front(), tracked.answer, tracked.why);
    (void)show(found->of, *tracked.measured, tracked.covariance, tracked.bound, tracked.answer);
    return document(*found);
}

Outcome estimate_sweep(const FileEstimate& o, const TrackerOptions& options) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    auto world = world_of(o, t_ns, t_ns + kSweepMotion_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto lidar = sensor_named(scene.lidars, o.sensor, "LiDAR", scene.file);
    if (!lidar) return lidar.error();
    const Lidar& l = scene.lidars[*lidar];
    if (auto target = target_of(**world, l.mount, l.name, options.target); !target) return target.error();
    auto captured = read_sweep(o.sweep, *l.model, o.unit);
    if (!captured) return captured.error();
    for (const std::string& warning : captured->warnings) warn(warning);
    TracingThreads threads(o.threads);
    auto found = [&] {
        const Progress progress("estimating the pose in " + o.sweep);
        return threads.arena.execute([&] {
            return estimate_one_sweep(**world, {*lidar, t_ns, captured->sweep, o.no_truth}, options);
        });
    }();
    if (!found) {
        Error error = found.error();
        if (error.file.empty()) error.file = o.sweep;
        return error;
    }
    const CloudEstimate& e = found->cloud;
    if (!found->has_pose()) return no_pose(o.sweep, e.answer, e.answer.why);
    (void)show(found->of, e.T_lidar_target, e.covariance, e.bound, e.answer);
    say(
        fmt::format("  {} returns (its own body's left out), {} used, {} as the model has them; {} motions that "
                    "cannot be seen; {} iterations",
                    e.points, e.used, e.explained, e.observability.unobserved, e.iterations));
    nlohmann::json result = document(*found);
    result["capture"] = to_json(*captured);
    return result;
}

}  // namespace narpa::cli
