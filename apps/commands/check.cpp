// narpa check - checks the scene and this machine; names what is missing and how to fix it.
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>

#include "apps/cli.h"
#include "apps/commands/body_views.h"
#include "apps/commands/calibration.h"
#include "apps/commands/exposure_advice.h"
#include "apps/device_options.h"
#include "apps/scene_argument.h"
#include "apps/warnings.h"
#include "base/constants.h"
#include "base/write_file.h"
#include "dataset/recipe/recipe.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/usb_adapters.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/video/bulk_bridges.h"
#include "drivers/video/video_sink.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/lidar/lidar_sensor.h"
#include "emulator/world.h"
#include "protocols/can/dbc.h"
#include "protocols/lidar/lidar_model.h"
#include "rehearsal/scenario/scenario.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/keys/json_schema.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/material/bsdf_kind.h"
#include "renderer/scene_file/lidar_description.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/trajectory/trajectory_description.h"

namespace narpa::cli {
namespace {

struct CheckOptions {
    SceneArgument scene;
    std::string dbc, calibration, schema;
    std::vector<std::string> devices;
    DeviceOptions named;
};

/// One thing that a run may need from this machine.
struct Finding {
    std::string name;
    bool there = false;
    std::string detail, remedy;
};

Finding socketcan() {
    const int fd = ::socket(PF_CAN, SOCK_RAW, 1);  // CAN_RAW
    if (fd < 0)
        return {"SocketCAN", false, std::strerror(errno),
                "sudo modprobe can_raw (or use --can slcan:29537, which needs no kernel support)"};
    ::close(fd);
    return {"SocketCAN", true, "the kernel has it", ""};
}

Finding video_devices() {
    std::string found;
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator("/dev", error)) {
        const std::string name = entry.path().filename().string();
        if (name.starts_with("video")) found += (found.empty() ? "/dev/" : " /dev/") + name;
    }
    if (found.empty())
        return {
            "V4L2 devices", false, "no /dev/video*",
            "sudo modprobe v4l2loopback video_nr=10 exclusive_caps=1 max_buffers=8 (or --video CAMERA=FILE.y4m)"};
    return {"V4L2 devices", true, found, ""};
}

/// `prefix`: of the option's value for such a device, such as "usb:".
Finding usb_devices(const std::string& name, std::string_view prefix,
                    const Result<std::vector<PluggedUsbDevice>>& devices) {
    if (!devices) return {name, false, devices.error().what, devices.error().remedy};
    if (devices->empty()) return {name, false, "none is plugged in", ""};
    Finding f{name, true, "", ""};
    for (const PluggedUsbDevice& a : *devices) {
        f.detail += fmt::format("{}{}{} at {}{}", f.detail.empty() ? "" : ", ", prefix, a.name(), a.place,
                                a.trouble.empty() ? "" : " (" + a.trouble + ")");
        if (a.trouble.empty()) continue;
        f.there = false;
        f.remedy = usb_permission_remedy();
    }
    return f;
}

/// A resource limit of this process; root is not limited. `item`: its name and value in limits.conf.
Finding permission(std::string name, int resource, rlim_t needed, std::string_view what, std::string_view without,
                   std::string_view item) {
    rlimit limit{};
    ::getrlimit(static_cast<__rlimit_resource_t>(resource), &limit);
    if (::geteuid() == 0 || limit.rlim_cur >= needed)
        return {std::move(name), true, fmt::format("{} is permitted", what), ""};
    const char* user = ::getenv("USER");
    return {std::move(name), false, fmt::format(fmt::runtime(without), limit.rlim_cur / 1024),
            fmt::format("echo \"{} - {}\" | sudo tee -a /etc/security/limits.d/narpa.conf, then log in again",
                        user ? user : "USER", item)};
}

/// The number of materials of each kind.
std::map<std::string_view, int> material_kinds(const Scene& scene) {
    std::map<std::string_view, int> count;
    for (const Material& m : scene.materials) ++count[m.kind->name];
    return count;
}

nlohmann::json describe_shape(const Scene& scene, const Body& body) {
    if (const int* const mesh = std::get_if<int>(&body.shape))
        return {{"triangles", scene.meshes[static_cast<std::size_t>(*mesh)].faces.size()}};
    const auto& [kind, values, material] = std::get<ExactShape>(body.shape);
    nlohmann::json out;
    auto value = values.begin();
    for (const TableKey& key : kind->keys.rows) {
        const int count = key.value.counts[0];  // 0: a number
        auto& of_key = out[fmt::format("{}_{}", kind->name, key.name)];
        if (count == 0) of_key = *value++;
        for (int i = 0; i < count; ++i) of_key.push_back(*value++);
    }
    return out;
}

std::string_view kind_name(const Light& light) {
    return Light::kKindNames[static_cast<std::size_t>(light.kind)];
}

nlohmann::json describe(const World& world) {
    const Scene& s = world.scene();
    nlohmann::json bodies = nlohmann::json::array(), cameras = nlohmann::json::array(),
                   lidars = nlohmann::json::array(), lights = nlohmann::json::array();
    for (const Body& b : s.bodies) {
        nlohmann::json body{{"name", b.name},
                            {"can_id", b.can_id ? nlohmann::json(*b.can_id) : nlohmann::json(nullptr)}};
        body.update(describe_shape(s, b));
        bodies.push_back(body);
    }
    for (const Camera& c : s.cameras)
        cameras.push_back({{"name", c.name},
                           {"width", c.width},
                           {"height", c.height},
                           {"format", std::string(name(c.format))},
                           {"rate_hz", 1e9 / static_cast<double>(c.period_ns)},
                           {"detector", c.detector.has_value()},
                           {"lens", c.optics.lens.has_value()}});
    for (const Lidar& l : s.lidars)
        lidars.push_back({{"name", l.name}, {"model", l.model->spec().name}, {"rate_hz", l.model->spec().rate_hz}});
    for (const Light& l : s.lights) lights.push_back({{"name", l.name}, {"kind", kind_name(l)}});
    const std::size_t stars = s.stars ? s.stars->stars.size() : 0;
    nlohmann::json render{{"method", RenderSettings::kMethodNames[static_cast<std::size_t>(s.render.method)]}};
    if (s.render.budget_rays > 0)
        render["budget_rays"] = s.render.budget_rays;
    else if (s.render.budget_ns > 0)
        render["budget_ms"] = static_cast<double>(s.render.budget_ns) * 1e-6;
    else
        render["spp"] = s.render.spp;
    if (s.render.method == RenderSettings::Method::path) render["max_depth"] = s.render.max_depth;
    return {{"name", s.name},
            {"render", render},
            {"lights", lights},
            {"stars", stars},
            {"bodies", bodies},
            {"cameras", cameras},
            {"lidars", lidars},
            {"triangles", world.tracer().triangle_count()},
            {"materials", s.materials.size()},
            {"material_kinds", material_kinds(s)},
            {"textures", s.textures.size()},
            {"warnings", s.warnings}};
}

std::string light_words(const Light& l) {
    switch (l.kind) {
        case Light::Kind::rectangle: return fmt::format("rectangle of {:g} x {:g} m", l.width_m, l.height_m);
        case Light::Kind::disc: return fmt::format("disc of radius {:g} m", l.radius_m);
        case Light::Kind::point:
        case Light::Kind::directional: break;
    }
    return std::string(kind_name(l));
}

std::string budget_words(const RenderSettings& r) {
    if (r.budget_rays > 0) return fmt::format("at most {} rays per frame", r.budget_rays);
    if (r.budget_ns > 0)
        return fmt::format("{:g} ms from the end of an exposure to the hand-over",
                           static_cast<double>(r.budget_ns) * 1e-6);
    return fmt::format("{} sample{} per pixel", r.spp, r.spp > 1 ? "s" : "");
}

void print_light(const Scene& s) {
    const bool path = s.render.method == RenderSettings::Method::path;
    say(fmt::format(
        "  render: {}, {}",
        path ? fmt::format("path tracing over at most {} surfaces", s.render.max_depth) : "direct light",
        budget_words(s.render)));
    std::string kinds;
    for (const auto& [kind, count] : material_kinds(s))
        kinds += fmt::format("{}{} {}", kinds.empty() ? "" : ", ", count, kind);
    if (!kinds.empty()) say("  materials: " + kinds);
    for (const Light& l : s.lights)
        say(fmt::format("  light {}: {}{}", l.name, light_words(l),
                        l.mount < 0 ? "" : " on body " + s.bodies[static_cast<std::size_t>(l.mount)].name));
}

/// Stars in the view of a camera at time 0, hidden by bodies or not.
std::size_t stars_in_view(const World& world, const Camera& camera) {
    const StarField& field = *world.scene().stars;
    BodyPoses at(world.scene().bodies.size());
    world.place(0, camera.mount, at);
    const Quat q_icrs_camera = field.q_icrs_world * world.camera_pose(camera, 0, at).q;
    const CameraModel& model = *camera.model;
    return static_cast<std::size_t>(std::ranges::count_if(field.stars, [&](const Star& star) {
        const auto p = model.project(conjugate(q_icrs_camera) * star.direction);
        return p && p->x > -0.5 && p->x < camera.width - 0.5 && p->y > -0.5 && p->y < camera.height - 0.5 &&
               model.sees(*p);
    }));
}

void print_scene(const World& world) {
    const Scene& s = world.scene();
    say(fmt::format("scene \"{}\": {} bodies, {} triangles, {} materials, {} textures", s.name, s.bodies.size(),
                    world.tracer().triangle_count(), s.materials.size(), s.textures.size()));
    print_light(s);
    for (const Camera& c : s.cameras)
        say(fmt::format("  camera {}: {} x {} {} at {:.6g} Hz{}", c.name, c.width, c.height, name(c.format),
                        1e9 / static_cast<double>(c.period_ns), c.optics.lens ? ", with a lens" : ""));
    if (s.stars) {
        say(fmt::format("  stars: {}", s.stars->stars.size()));
        for (const Camera& c : s.cameras)
            say(fmt::format("  camera {}: {} stars in its view at time 0", c.name, stars_in_view(world, c)));
    }
    for (const Lidar& l : s.lidars)
        say(fmt::format("  lidar {}: {} at {} turns per second", l.name, l.model->spec().name,
                        l.model->spec().rate_hz));
}

Status save_dbc(const Scene& scene, const std::string& path) {
    std::vector<CanBody> bodies;
    for (const Body& b : scene.bodies)
        if (b.can_id) bodies.push_back({b.name, *b.can_id});
    return write_file(path, write_dbc(bodies, static_cast<int>(scene.cameras.size())));
}

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

void check_own_hulls(const World& world, nlohmann::json& document) {
    const Scene& s = world.scene();
    for (std::size_t i = 0; i < s.cameras.size(); ++i)
        check_own_hull(world, "camera " + s.cameras[i].name, "pixels show", 0.25, s.cameras[i].mount,
                       s.cameras[i].T_mount_camera, rays_of(s.cameras[i]), document["cameras"][i]);
    for (std::size_t i = 0; i < s.lidars.size(); ++i)
        check_own_hull(world, "lidar " + s.lidars[i].name, "shots meet", 0.5, s.lidars[i].mount,
                       s.lidars[i].T_mount_lidar, rays_of(s.lidars[i]), document["lidars"][i]);
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

/// Checks the exposure of each camera.
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

/// The finding for a device that cannot be opened, without the device's name in the error text.
Finding absent(const std::string& spec, const Error& e) {
    const std::string name = spec == "usb:" || spec == "bulk:" ? spec.substr(0, spec.size() - 1) : spec;  // any
    return {name, false, e.what.starts_with(spec + ": ") ? e.what.substr(spec.size() + 2) : e.what, e.remedy};
}

/// Tests a device as its kind says. `open`: as a run would.
Result<Finding> test_device(const std::string& spec, const DeviceKind* kind, const auto& open) {
    if (kind && kind->destination == Destination::new_file) {
        const Status writable = check_writable(spec);
        return writable ? Finding{spec, true, "can be written", ""} : absent(spec, writable.error());
    }
    const auto device = open();
    if (device) return Finding{spec, true, (*device)->description(), ""};
    if (device.error().kind == ErrorKind::bad_input) return device.error();
    return absent(spec, device.error());
}
Result<Finding> test_bus(const std::string& spec) {
    return test_device(spec, can_bus_kind(spec), [&] { return open_can_bus(spec, CanRole::hub); });
}
Result<Finding> test_video(const std::string& spec, const VideoFormat& format) {
    return test_device(spec, video_sink_kind(spec), [&] { return open_video_sink(spec, format, WhenFull::drop); });
}
Result<Finding> test_lidar(const std::string& spec, const Lidar& lidar, bool has_bus, const Scene& scene) {
    const DeviceKind* kind = packet_sink_kind(spec);
    if (kind && kind->destination == Destination::bus) {
        if (auto good = check_beams_on_can(lidar, has_bus, scene.file); !good) return good.error();
        return Finding{spec, true, "each shot of LiDAR " + lidar.name + " on the CAN bus", ""};
    }
    return test_device(spec, kind, [&] {
        return open_packet_sink(spec, lidar.model->spec().network, scene.epoch_unix_ns, false,
                                lidar.model->metadata());
    });
}

/// A device without an option: the text alone shows what it is.
Result<Finding> test_positional(const std::string& spec) {
    const auto shown = [&](const DeviceKind* kind) { return kind && kind->shown_by(spec); };
    const bool bus = shown(can_bus_kind(spec)), video = shown(video_sink_kind(spec)),
               lidar = shown(packet_sink_kind(spec));
    if (bus && !video && !lidar) return test_bus(spec);
    if (video && !bus && !lidar) return test_video(spec, {640, 480, PixelFormat::grey, 100'000'000});
    if (!bus && !video && !lidar)
        return Error{
            "is neither a CAN bus nor a video device, expected what --can or --video of `narpa check --help` shows",
            spec};
    const std::string can_option = "--can " + spec, video_option = "--video CAMERA=" + spec,
                      lidar_option = "--lidar LIDAR=" + spec;
    std::vector<std::string_view> options;
    if (bus) options.push_back(can_option);
    if (video) options.push_back(video_option);
    if (lidar) options.push_back(lidar_option);
    return Error{"needs the option that says what it is, expected " + list_of(options), spec};
}

/// Tests the devices of the command line.
Status test_devices(const CheckOptions& o, const Scene& scene, std::vector<Finding>& findings) {
    const auto add = [&](Result<Finding> finding) -> Status {
        if (!finding) return finding.error();
        findings.push_back(*std::move(finding));
        return Ok{};
    };
    const auto video = o.named.video(), lidar = o.named.lidar();
    if (!video) return video.error();
    if (!lidar) return lidar.error();
    for (const std::string& spec : o.devices)
        if (auto good = add(test_positional(spec)); !good) return good;
    if (!o.named.bus.empty())
        if (auto good = add(test_bus(o.named.bus)); !good) return good;
    for (const auto& [name, spec] : *video) {
        const auto index = sensor_named(scene.cameras, name, "camera", scene.file);
        if (!index) return index.error();
        const Camera& c = scene.cameras[*index];
        if (auto good = add(test_video(spec, {c.width, c.height, c.format, c.period_ns})); !good) return good;
    }
    for (const auto& [name, spec] : *lidar) {
        const auto index = sensor_named(scene.lidars, name, "LiDAR", scene.file);
        if (!index) return index.error();
        if (auto good = add(test_lidar(spec, scene.lidars[*index], !o.named.bus.empty(), scene)); !good)
            return good;
    }
    return Ok{};
}

/// Prints the scenario; returns its part of the document.
nlohmann::json describe(const rehearsal::Scenario& s) {
    const auto names = [](const auto& list) {
        std::vector<std::string> out;
        for (const auto& one : list) out.push_back(one.name);
        return out;
    };
    const auto& n = s.navigation;
    say(fmt::format("scenario \"{}\": {}, at most {:g} s; its legs take about {:.0f} s", s.name, s.title,
                    s.duration_s, s.legs_duration_s()));
    if (s.legs_duration_s() > s.duration_s)
        warn(fmt::format("the run ends before its legs are flown: expected duration_s of [scenario] above {:.0f}",
                         std::ceil(s.legs_duration_s())));
    say(fmt::format("  scene: {}", s.scene));
    std::vector<std::string> sensors = n.cameras;
    if (n.camera_method != &camera_methods().front())
        for (std::string& camera : sensors) camera += fmt::format(" ({})", n.camera_method->measures);
    sensors.insert(sensors.end(), n.lidars.begin(), n.lidars.end());
    say(fmt::format("  {} flies to {}, by {}", s.chaser.body, s.target.body, fmt::join(sensors, ", ")));
    say(fmt::format("  legs: {}", fmt::join(names(s.legs), ", ")));
    return {{"file", s.file},
            {"name", s.name},
            {"scene", s.scene},
            {"cameras", n.cameras},
            {"lidars", n.lidars},
            {"legs", names(s.legs)},
            {"duration_s", s.duration_s},
            {"legs_s", s.legs_duration_s()}};
}

/// Kinds of files that have a schema.
struct SchemaRow {
    std::string name;
    const TableKeys& keys;
};
const std::array<SchemaRow, 5> kSchemas{{{"scene", kSceneFileKeys},
                                         {"lidar", kLidarDescriptionKeys},
                                         {"trajectory", kTrajectoryFileKeys},
                                         {"scenario", rehearsal::kScenarioFileKeys},
                                         {"dataset", dataset::kRecipeFileKeys}}};

Outcome print_schema(const std::string& name) {
    const auto row = std::ranges::find(kSchemas, name, &SchemaRow::name);
    fmt::print("{}", json_schema(row->keys, fmt::format("narpa {}", name)));
    return nlohmann::json();  // the schema is the one document
}

/// Where the argument names a scenario or a recipe of a data set: prints it, adds its part to the document, and
/// goes on with its scene.
Status find_scene(SceneArgument& argument, nlohmann::json& document) {
    const auto named = find_file(FileKind::scene, argument.file);
    if (named) return Ok{};
    if (const auto file = find_file(FileKind::scenario, argument.file)) {
        const auto scenario = rehearsal::read_scenario(*file, argument.sets);
        if (!scenario) return scenario.error();
        document["scenario"] = describe(*scenario);
        argument = {scenario->scene, scenario->scene_overrides};
    } else if (const auto recipe_file = find_file(FileKind::dataset, argument.file)) {
        const auto recipe = dataset::read_recipe(*recipe_file, argument.sets);
        if (!recipe) return recipe.error();
        say(fmt::format("recipe \"{}\" of a data set; its scene: {}", recipe->name, recipe->scene));
        document["dataset"] = {{"file", recipe->file}, {"name", recipe->name}, {"scene", recipe->scene}};
        argument = {recipe->scene, recipe->sets};
    } else {
        return named.error();
    }
    return Ok{};
}

Outcome check(const CheckOptions& o) {
    if (!o.schema.empty()) return print_schema(o.schema);
    if (o.scene.file.empty()) return Error{"SCENE is required"};
    nlohmann::json document;
    SceneArgument scene_argument = o.scene;
    if (auto named = find_scene(scene_argument, document); !named) return named.error();
    auto scene = scene_argument.load_anyway();
    if (!scene) return scene.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    print_scene(**world);
    nlohmann::json scene_document = describe(**world);
    check_body_views(**world, scene_document);
    check_own_hulls(**world, scene_document);
    check_exposures(**world, scene_document);
    if (!o.calibration.empty()) {
        if (auto written = write_calibration((*world)->scene(), o.calibration); !written) return written.error();
        say("wrote " + o.calibration + "/calibration.json and CAMERA.yaml of each camera");
    }
    if (!o.dbc.empty()) {
        if (auto made = make_folder_of(o.dbc); !made) return made.error();
        if (auto written = save_dbc((*world)->scene(), o.dbc); !written) return written.error();
        say("wrote " + o.dbc);
    }

    std::vector<Finding> findings{
        socketcan(),
        usb_devices("USB-CAN adapters", "usb:", find_usb_adapters()),
        video_devices(),
        usb_devices("USB frame bridges", "bulk:", find_bulk_bridges()),

        permission("real-time priority", RLIMIT_RTPRIO, 60, "SCHED_FIFO",
                   "SCHED_FIFO is not permitted: deadlines may slip under load", "rtprio 90"),
        permission("locked memory", RLIMIT_MEMLOCK, RLIM_INFINITY, "mlockall",
                   "limit {} KiB: page faults may cost deadlines", "memlock unlimited")};
    const std::size_t general = findings.size();
    if (auto tested = test_devices(o, (*world)->scene(), findings); !tested) return tested.error();
    nlohmann::json machine = nlohmann::json::array();
    for (const Finding& f : findings) {
        say(fmt::format("  [{}] {}: {}{}", f.there ? "ok" : "--", f.name, f.detail,
                        f.remedy.empty() ? "" : "\n         try: " + f.remedy));
        machine.push_back({{"name", f.name}, {"there", f.there}, {"detail", f.detail}, {"remedy", f.remedy}});
    }
    document.update({{"scene", scene_document}, {"machine", machine}});
    for (std::size_t i = general; i < findings.size(); ++i) {  // devices named on the command line must exist
        if (findings[i].there) continue;
        const Error missing{findings[i].detail, findings[i].name, 0, 0, ErrorKind::missing, findings[i].remedy};
        say("narpa: " + missing.text());
        if (!document.contains("error")) document.update(to_json(missing));  // the first; `machine` has all
    }
    return document;
}

}  // namespace

Command add_check(Parser app) {
    auto o = std::make_shared<CheckOptions>();
    const Parser c = app.subcommand(
        "check", "Check a scene, scenario or recipe of a data set, and this machine; names what is missing");
    c.option("SCENE", o->scene.file, "Scene, scenario or recipe file (TOML), or a name that `narpa list` shows");
    o->scene.add_settings_to(c);
    c.option("DEVICE", o->devices,
             "Devices that the run will need, which are opened as a test: vcan0, slcan:PORT, usb:, /dev/video10, "
             "bulk: ... One that may be several things, such as udp:, needs its option");
    o->named.add_to(c);
    c.option(
         "--calibration", o->calibration,
         "Write CAMERA.yaml (camera_info of ROS) and calibration.json here: matrix, distortion and mount of each "
         "sensor")
        .type_name("DIR");
    c.option("--dbc", o->dbc, "Write the DBC of the scene's commanded bodies to this file").type_name("FILE");
    std::vector<std::string> schemas;
    for (const SchemaRow& row : kSchemas) schemas.push_back(row.name);
    c.option("--schema", o->schema, "Print the JSON schema of such files, for editors, and check nothing")
        .one_of(schemas);
    c.group("Start here");
    c.examples({"narpa check docking", "narpa check my-scene.toml vcan0 /dev/video10",
                "narpa check docking --can vcan0 --video nav=tcp:5000 --lidar top=udp:192.168.1.70:2368",
                "narpa check docking --dbc out/docking.dbc"});
    return [o] { return check(*o); };
}

}  // namespace narpa::cli
