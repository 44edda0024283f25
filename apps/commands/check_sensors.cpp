#include "apps/commands/check_sensors.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "apps/cli.h"
#include "apps/commands/exposure_advice.h"
#include "apps/progress.h"
#include "apps/warnings.h"
#include "base/constants.h"
#include "emulator/camera/camera_unit.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/camera/scene_camera.h"

namespace narpa::cli {
namespace {

/// Share of a sensor's rays that hit the body that carries it first.
struct SelfOcclusion {
    double share = 0, nearest_m = kInfinity;
};
/// `rays` in the sensor's frame.
SelfOcclusion self_occlusion(const World& world, int mount, const Rigid3& T_mount_sensor,
                             const std::vector<Ray>& rays) {
    BodyPoses at(world.scene().bodies.size());
    world.place(0, mount, at);
    const Rigid3 T_world_sensor = world.sensor_pose(mount, T_mount_sensor, at);
    SelfOcclusion own;
    int hits = 0;
    for (const Ray& ray : rays) {
        const Hit hit = world.tracer().intersect(
            at, {T_world_sensor * ray.origin, T_world_sensor.q * ray.direction}, kInfinity);
        if (hit.body < 0 || hit.body != mount) continue;
        ++hits;
        own.nearest_m = std::min(own.nearest_m, hit.range_m);
    }
    own.share = static_cast<double>(hits) / static_cast<double>(rays.size());
    return own;
}

/// A grid over the image.
std::vector<Ray> rays_of(const Camera& c) {
    constexpr int kAcross = 64, kDown = 48;
    const CameraModel& model = *c.model;
    std::vector<Ray> rays;
    for (int j = 0; j < kDown; ++j)
        for (int i = 0; i < kAcross; ++i)
            rays.push_back({{},
                            normalized(model.direction(
                                {(i + 0.5) / kAcross * c.width - 0.5, (j + 0.5) / kDown * c.height - 0.5}))});
    return rays;
}

/// The shots of a turn.
std::vector<Ray> rays_of(const Lidar& l) {
    const LidarSpec& spec = l.model->spec();
    std::vector<LidarShot> shots(spec.shots_per_packet);
    std::vector<Ray> rays;
    for (std::int64_t p = 0; static_cast<double>(l.model->packet_start_ns(p)) < 1e9 / spec.rate_hz; ++p) {
        l.model->shots(p, shots);
        for (const LidarShot& s : shots) rays.push_back({s.origin_m, s.direction});
    }
    return rays;
}

/// A sensor inside its hull is a usual mistake of a new scene; a bracket or a nozzle in the view is none. From
/// outside a convex hull a camera may see little of it, a LiDAR that turns may meet it with half of its shots.
void check_own_hull(const World& world, const std::string& sensor, const char* rays_do, double much, int mount,
                    const Rigid3& T_mount_sensor, const std::vector<Ray>& rays, nlohmann::json& document) {
    if (mount < 0) return;
    const SelfOcclusion own = self_occlusion(world, mount, T_mount_sensor, rays);
    document["own_hull_share"] = own.share;
    std::string what = fmt::format("{}: {:.{}f} % of its {} body {}, which carries it", sensor, 100 * own.share,
                                   own.share > 0 && own.share < 0.01 ? 2 : 0, rays_do,
                                   world.scene().bodies[static_cast<std::size_t>(mount)].name);
    if (own.share > 0) {
        document["own_hull_nearest_m"] = own.nearest_m;
        what += fmt::format(", from {:.3g} m on", own.nearest_m);
    }
    if (own.share < much) return say("  " + what);
    warn(
        what +
        "; is it inside its hull? Move its position_m out of the mesh, or check its axes (camera: x right, y down, "
        "z forward; LiDAR: x right, y forward, z up)");
}

/// Signal levels of a frame at time 0, with the bodies where the scene places them. Eight rays a pixel suffice for
/// a mean level; a large image gets fewer, so that the frame takes a second or less.
SignalLevels first_levels(const World& world, const Camera& camera) {
    constexpr std::uint64_t kRays = 2'000'000;
    const Scene& s = world.scene();
    BodyPoses at(s.bodies.size());
    std::vector<Motion> motions(s.bodies.size());
    world.place(0, camera.mount, at, motions);
    const std::int64_t half_ns = exposure_ns(camera) / 2;
    const CameraPose pose = camera_pose(world, camera, at, -half_ns, half_ns, motions);
    const std::uint64_t pixels =
        static_cast<std::uint64_t>(camera.width) * static_cast<std::uint64_t>(camera.height);
    FrameSettings settings;
    settings.method = s.render.method;
    settings.max_depth = s.render.max_depth;
    settings.seed = s.render.seed;
    settings.budget.kind = FrameBudget::Kind::rays;
    settings.budget.rays = std::max(2 * pixels, std::min(8 * pixels, kRays));
    RadianceImage radiance(camera.width, camera.height);
    render_radiance(world.render_scene(), at, camera, pose, settings, radiance);
    return signal_levels(camera, radiance);
}

}  // namespace

void check_own_hulls(const World& world, nlohmann::json& document) {
    const Scene& s = world.scene();
    for (std::size_t i = 0; i < s.cameras.size(); ++i)
        check_own_hull(world, "camera " + s.cameras[i].name, "pixels show", 0.25, s.cameras[i].mount,
                       s.cameras[i].T_mount_camera, rays_of(s.cameras[i]), document["cameras"][i]);
    for (std::size_t i = 0; i < s.lidars.size(); ++i)
        check_own_hull(world, "lidar " + s.lidars[i].name, "shots meet", 0.5, s.lidars[i].mount,
                       s.lidars[i].T_mount_lidar, rays_of(s.lidars[i]), document["lidars"][i]);
}

void check_exposures(const World& world, nlohmann::json& document) {
    const Scene& s = world.scene();
    for (std::size_t i = 0; i < s.cameras.size(); ++i) {
        const SignalLevels levels = [&] {
            const Progress progress("exposing camera " + s.cameras[i].name);
            return first_levels(world, s.cameras[i]);
        }();
        document["cameras"][i]["signal"] = signal_json(levels);
        const std::string camera = "camera " + s.cameras[i].name + ": ";
        if (const std::string advice = exposure_advice(s.cameras[i], levels); !advice.empty())
            warn(camera + "at time 0 " + advice);
        else if (!(levels.brightest > 0))
            say("  " + camera + "sees no light at time 0, where the scene places its bodies");
        else
            say(
                fmt::format("  {}at time 0 {} of its pixels have light, {} are saturated; the bright ones have {} "
                            "of full scale",
                            camera, percent(levels.lit_share), percent(levels.saturated_share),
                            levels.bright > 1 ? "more than 100 %" : percent(levels.bright)));
    }
}

}  // namespace narpa::cli
