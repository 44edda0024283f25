#include "apps/estimate_one.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <random>

#include "drivers/lidar/packet_source.h"
#include "emulator/threads.h"
#include "estimator/cloud/cloud_icp.h"
#include "estimator/cloud/sweep_points.h"
#include "estimator/view/measured_image.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa::cli {
namespace {

Result<std::unique_ptr<World>> world_of(const OneOptions& o, std::int64_t t_ns, std::int64_t until_ns) {
    auto scene = load_scene(o.scene);
    if (!scene) return scene.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world;
    if (auto loaded = o.pose.load(**world, t_ns, until_ns); !loaded) return loaded.error();
    return world;
}

nlohmann::json pose_json(const Rigid3& T) {
    return {{"position_m", {T.t.x, T.t.y, T.t.z}}, {"attitude_wxyz", {T.q.w, T.q.x, T.q.y, T.q.z}}};
}

/// Of an estimate and its truth: the document, and the words.
nlohmann::json tell(const std::string& what, const Rigid3& T, const Matrix6& covariance, const Matrix6& bound,
                    const Rigid3& truth) {
    const Vector6 error = error_between(T, truth);
    const double nees = normalised_error_squared(error, covariance);
    say(
        fmt::format("{}: position ({:.6g}, {:.6g}, {:.6g}) m, attitude ({:.7f}, {:.7f}, {:.7f}, {:.7f})\n"
                    "  off the truth by {:.4f} deg and {:.3g} m; standard deviations {:.4f} deg, {:.3g} m; bound "
                    "{:.4f} deg, {:.3g} m; NEES {:.2f} (6 expected)",
                    what, T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z, error.head<3>().norm() / kDegree,
                    error.tail<3>().norm(), rotation_sigma(covariance) / kDegree, position_sigma(covariance),
                    rotation_sigma(bound) / kDegree, position_sigma(bound), nees));
    nlohmann::json rows = nlohmann::json::array();
    for (int i = 0; i < 6; ++i) {
        nlohmann::json row = nlohmann::json::array();
        for (int j = 0; j < 6; ++j) row.push_back(covariance(i, j));
        rows.push_back(row);
    }
    return {{"passed", true},
            {"pose", pose_json(T)},
            {"truth", pose_json(truth)},
            {"covariance", rows},
            {"error_rotation_rad", error.head<3>().norm()},
            {"error_position_m", error.tail<3>().norm()},
            {"bound_rotation_rad", rotation_sigma(bound)},
            {"bound_position_m", position_sigma(bound)},
            {"nees", std::isfinite(nees) ? nlohmann::json(nees) : nlohmann::json(nullptr)}};
}

Result<std::vector<std::uint8_t>> bytes_of(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(file), {}};
    if (!file.is_open() || file.bad()) return Error{"cannot be read, expected the bytes of a frame", path};
    return bytes;
}

/// The returns of one turn from the capture's first packet on; times count from its first shot.
Result<std::vector<RangePoint>> points_of(const std::string& path, const Lidar& lidar) {
    const LidarSpec& spec = lidar.model->spec();
    auto datagrams = read_datagrams(path, spec.data_packet_bytes);
    if (!datagrams) return datagrams.error();
    std::vector<RangePoint> points;
    std::vector<LidarPoint> decoded(spec.shots_per_packet);
    std::optional<std::int64_t> first_ns;
    for (const auto& bytes : *datagrams) {
        const auto time_ns = lidar.model->packet_time(bytes, first_ns.value_or(0));
        if (!time_ns) continue;
        if (!first_ns) first_ns = time_ns;
        const std::int64_t after_ns = *time_ns - *first_ns;
        if (after_ns < 0 || static_cast<double>(after_ns) >= 1e9 / lidar.rate_hz) break;
        append_points(std::span(decoded).first(lidar.model->points(bytes, decoded)), after_ns, points);
    }
    if (!first_ns)
        return Error{fmt::format("holds no data packet of a {}, expected at least one", spec.name), path};
    return points;
}

/// Takes out what the LiDAR sees of the body that it rides on, which lies as it knows.
void cut_own_body(std::vector<RangePoint>& points, const World& world, const Lidar& lidar, const BodyPoses& at) {
    const Rigid3 T_world_lidar = world.sensor_pose(lidar.mount, lidar.T_mount_lidar, at);
    constexpr double kAlike_m = 0.1;
    std::erase_if(points, [&](const RangePoint& p) {
        const Ray beam{T_world_lidar * p.origin_m, T_world_lidar.q * p.direction};
        const Hit hit = world.tracer().intersect(at, beam, p.range_m + kAlike_m);
        return hit.body >= 0 && hit.body == lidar.mount && hit.range_m > p.range_m - kAlike_m;
    });
}

/// How the target moves in the LiDAR's axes from one time to another.
SweepMotion motion_between(const Rigid3& T_lidar_target, const Rigid3& later, double dt_s) {
    return {(later.t - T_lidar_target.t) / dt_s, rotation_vector(later.q * conjugate(T_lidar_target.q)) / dt_s};
}

}  // namespace

Outcome estimate_frame(const OneOptions& o) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    auto world = world_of(o, t_ns, t_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto camera = sensor_named(scene.cameras, o.sensor, "camera", scene.file);
    if (!camera) return camera.error();
    auto tracker = FrameTracker::create(**world, *camera, o.tracker);
    if (!tracker) return tracker.error();
    auto bytes = bytes_of(o.frame);
    if (!bytes) return bytes.error();
    if (auto image = measured_image(scene.cameras[*camera], *bytes); !image)
        return Error{image.error().what, o.frame};
    BodyPoses at(scene.bodies.size());
    (*world)->place(t_ns, scene.cameras[*camera].mount, at);
    TracingThreads threads(o.threads);
    TrackedFrame tracked;
    threads.arena.execute([&] { tracked = (*tracker)->take(0, t_ns, *bytes, at); });
    if (!tracked.measured) return Error{"gives no pose: " + tracked.why, o.frame, 0, 0, ErrorKind::failed};
    nlohmann::json document =
        tell(fmt::format("{} in camera {}", scene.bodies[(*tracker)->target()].name, scene.cameras[*camera].name),
             *tracked.measured, tracked.covariance, tracked.bound, tracked.truth);
    document["matches"] = tracked.matches;
    document["renders"] = tracked.renders;
    return document;
}

Outcome estimate_sweep(const OneOptions& o) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    constexpr std::int64_t kLater_ns = 10'000'000;
    auto world = world_of(o, t_ns, t_ns + kLater_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto index = sensor_named(scene.lidars, o.sensor, "LiDAR", scene.file);
    if (!index) return index.error();
    const Lidar& lidar = scene.lidars[*index];
    auto target = target_of(**world, lidar.mount, lidar.name, o.tracker.target);
    if (!target) return target.error();
    auto points = points_of(o.sweep, lidar);
    if (!points) return points.error();
    BodyPoses then(scene.bodies.size());
    (*world)->place(t_ns, lidar.mount, then);
    cut_own_body(*points, **world, lidar, then);
    const auto T_lidar_target_at = [&](std::int64_t t) {
        BodyPoses at(scene.bodies.size());
        (*world)->place(t, lidar.mount, at);
        return inverse((*world)->sensor_pose(lidar.mount, lidar.T_mount_lidar, at)) * at.T_world_body[*target];
    };
    const Rigid3 truth = T_lidar_target_at(t_ns);
    const SweepMotion motion = motion_between(truth, T_lidar_target_at(t_ns + kLater_ns), kLater_ns * 1e-9);
    std::mt19937_64 random(o.tracker.seed);
    const Rigid3 guess = off_truth(truth, o.tracker, random);
    const double search_m = 0.01 * o.tracker.start_percent * norm(truth.t) +
                            o.tracker.start_deg * kDegree * (*world)->tracer().bounding_radius_m(*target);
    IcpSettings settings;
    settings.noise.range_m = o.range_noise_m;
    auto icp = CloudIcp::create((*world)->tracer(), *target, settings);
    if (!icp) return icp.error();
    TracingThreads threads(o.threads);
    std::optional<Result<CloudEstimate>> found;
    threads.arena.execute([&] { found.emplace(icp->align(*points, motion, guess, search_m)); });
    if (!*found) return Error{found->error().what, o.sweep, 0, 0, ErrorKind::failed};
    const CloudEstimate& e = **found;
    nlohmann::json document = tell(fmt::format("{} in LiDAR {}", scene.bodies[*target].name, lidar.name),
                                   e.T_lidar_target, e.covariance, e.bound, truth);
    const int unobserved = e.observability.unobserved;
    say(fmt::format("  {} points, {} used, {} as the model has them; {} motions that cannot be seen; {} iterations",
                    e.points, e.used, e.explained, unobserved, e.iterations));
    if (!e.credible) say("  not credible: the pose does not explain its points, or did not settle");
    document["passed"] = document["credible"] = e.credible;
    document["points"] = e.points;
    document["used"] = e.used;
    document["explained"] = e.explained;
    document["unobserved"] = unobserved;
    document["iterations"] = e.iterations;
    return document;
}

}  // namespace narpa::cli
