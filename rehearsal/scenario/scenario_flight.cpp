// How the chaser flies: legs, navigation, control.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocols/lidar/lidar_model.h"
#include "rehearsal/scenario/scenario_tables.h"
#include "renderer/keys/toml_file.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {
namespace {

std::vector<std::string_view> camera_method_names() {
    std::vector<std::string_view> names;
    for (const CameraMethod& m : camera_methods()) names.push_back(m.name);
    return names;
}

constexpr TableKey kLegRows[]{
    {"name", rows::text()},
    {"to_m", rows::vec3()},
    {"arc_deg", rows::number({.low = -3600, .high = 3600})},
    {"axis", rows::direction()},
    {"speed_m_s", rows::number(kPositive)},
    {"hold_s", rows::number({.low = 0, .high = kLongest_s})},
    {"within_m", rows::number(kPositive)},
    {"contact", rows::boolean()},
    {"look_at_target", rows::boolean()},
    {"descent_s", rows::number(kPositive)},
    {"end_velocity_m_s", rows::vec3()},
};
constexpr TableKey kNavigationRows[]{
    {"cameras", rows::texts()},
    {"camera_method", rows::choice(camera_method_names)},
    {"lidars", rows::texts()},
    {"velocimeters", rows::texts()},
    {"map", rows::file()},
    {"map_sigma_m", rows::number(kNotNegative)},
    {"map_correlation_m", rows::number(kNotNegative)},
    {"period_s", rows::number({.low = 0.01, .high = 100})},
    {"acceleration_psd", rows::number(kPositive)},
    {"angular_acceleration_psd", rows::number(kPositive)},
    {"abort_sigma_m", rows::number(kPositive)},
    {"abort_lost_s", rows::number(kPositive)},
    {"abort_off_m", rows::number(kPositive)},
};
constexpr auto kModelErrorRows = [] {
    std::array<TableKey, kModelErrors.size() + 1> all{{{"told", rows::number(kNotNegative)}}};
    for (std::size_t i = 0; i < kModelErrors.size(); ++i)
        all[i + 1] = {kModelErrors[i].name, rows::number(kNotNegative)};
    return all;
}();
constexpr TableKey kControlRows[]{
    {"bandwidth_rad_s", rows::number(kPositive)},
    {"attitude_bandwidth_rad_s", rows::number(kPositive)},
    {"damping", rows::number({.low = 0.1, .high = 10})},
    {"retreat_m_s", rows::number(kPositive)},
    {"turn_deg_s", rows::number(kPositive)},
};

void read_legs(TableReader& root, std::vector<Leg>& legs) {
    auto tables = root.tables("leg");
    for (TableReader& table : tables) {
        Leg leg;
        leg.name = table.text("name").value_or(fmt::format("leg {}", legs.size() + 1));
        leg.arc_deg = table.number("arc_deg");
        leg.descent_s = table.number("descent_s");
        if (leg.descent_s) {
            table.read("end_velocity_m_s", leg.end_velocity_m_s);
            table.refuse("speed_m_s", "belongs to legs without `descent_s`");
            table.refuse("arc_deg", "this leg is a descent, expected `to_m`");
            leg.arc_deg.reset();
        } else {
            table.refuse("end_velocity_m_s", "belongs to `descent_s`");
        }
        if (leg.arc_deg) {
            leg.axis = table.direction("axis").value_or(leg.axis);
            table.refuse("to_m", "this leg is an arc, expected either `to_m` or `arc_deg`");
        } else {
            table.require("to_m", "[x, y, z] in the target's port axes, or `arc_deg`");
            table.refuse("axis", "belongs to `arc_deg`");
            table.read("to_m", leg.to_m);
        }
        table.read("speed_m_s", leg.speed_m_s);
        table.read("hold_s", leg.hold_s);
        table.read("within_m", leg.within_m);
        table.read("contact", leg.contact);
        table.read("look_at_target", leg.look_at_target);
        if (leg.contact && leg.descent_s) table.fail("contact", "a descent ends before, expected a leg of its own");
        if (leg.contact && legs.size() + 1 != tables.size())
            table.fail("contact", "only the last leg may end with contact");
        table.finish();
        legs.push_back(std::move(leg));
    }
}

/// Reads the sensors that the chaser navigates by; they must be in the scene and on the chaser.
template <class Sensor>
std::vector<std::string> read_sensors(TableReader& table, const char* key, const std::vector<Sensor>& sensors,
                                      const Scene& scene, const std::string& chaser) {
    std::vector<std::string> names = table.texts(key).value_or(std::vector<std::string>{});
    for (auto at = names.begin(); at != names.end(); ++at) {
        const std::string& name = *at;
        const auto found = std::ranges::find(sensors, name, &Sensor::name);
        if (std::find(names.begin(), at, name) != at)
            table.fail(key, fmt::format("has \"{}\" twice", name));
        else if (found == sensors.end())
            table.fail(key, fmt::format("\"{}\" is not in {}", name, scene.file));
        else if (found->mount < 0 || scene.bodies[static_cast<std::size_t>(found->mount)].name != chaser)
            table.fail(key, fmt::format("\"{}\" is not mounted on the chaser, \"{}\"", name, chaser));
    }
    return names;
}

std::vector<std::string> read_velocimeters(TableReader& table, const Scene& scene, const std::string& chaser) {
    constexpr const char* kKey = "velocimeters";
    auto names = read_sensors(table, kKey, scene.lidars, scene, chaser);
    for (const Lidar& lidar : scene.lidars)
        if (std::ranges::find(names, lidar.name) != names.end() &&
            !(lidar.model->spec().measures_velocity && lidar.receiver.velocity_noise_m_s > 0))
            table.fail(kKey, fmt::format("\"{}\" measures no velocity or has no velocity_noise_m_s", lidar.name));
    return names;
}

template <class Named>
bool same_names(const std::vector<Named>& a, const std::vector<Named>& b) {
    return std::ranges::equal(a, b, {}, &Named::name, &Named::name);
}

/// Reads the map: another scene with the same bodies and sensors, of which only the shapes differ; of the file that
/// `s` has already in place of the one that the table names.
std::string read_map(TableReader& table, const Scenario& s, const Scene& scene) {
    const auto map = table.text("map");
    if (!map) return "";
    std::string path = s.navigation.scene.empty() ? beside(s.file, *map) : s.navigation.scene;
    const auto known = read_scene(path, s.map_overrides);
    if (!known) {
        table.fail("map", known.error().text());
    } else if (!same_names(known->bodies, scene.bodies) || !same_names(known->cameras, scene.cameras) ||
               !same_names(known->lidars, scene.lidars)) {
        table.fail("map", fmt::format("{} has other bodies or sensors, expected those of {} in the same order",
                                      path, scene.file));
    }
    return path;
}

void read_navigation(TableReader& root, Scenario& s, const Scene& scene) {
    auto table = root.table("navigation");
    if (!table) return;
    Navigation& n = s.navigation;
    n.cameras = read_sensors(*table, "cameras", scene.cameras, scene, s.chaser.body);
    if (const auto method = table->word("camera_method")) n.camera_method = &camera_methods()[*method];
    n.lidars = read_sensors(*table, "lidars", scene.lidars, scene, s.chaser.body);
    n.velocimeters = read_velocimeters(*table, scene, s.chaser.body);
    const bool over_ground = s.orbit.model->over_ground && !n.velocimeters.empty();
    if (n.cameras.empty() && n.lidars.empty() && !over_ground)
        table->fail(table->has("lidars") ? "lidars" : "cameras",
                    "no sensor, expected a camera or a LiDAR to navigate by");
    n.scene = read_map(*table, s, scene);
    table->read("map_sigma_m", n.map_sigma_m);
    table->read("map_correlation_m", n.map_correlation_m);
    table->read("period_s", n.period_s);
    table->read("acceleration_psd", n.acceleration_psd);
    table->read("angular_acceleration_psd", n.angular_acceleration_psd);
    table->read("abort_sigma_m", n.abort_sigma_m);
    table->read("abort_lost_s", n.abort_lost_s);
    table->read("abort_off_m", n.abort_off_m);
    if (s.thrusters.min_on_s > n.period_s)
        table->fail("period_s", fmt::format("is {:g}, expected at least min_on_s of [thrusters], {:g}: no pulse is "
                                            "longer than a period",
                                            n.period_s, s.thrusters.min_on_s));
    const double poses = n.period_s * s.pose_rate_hz;
    if (std::abs(poses - std::round(poses)) > 1e-9 || poses < 1)
        table->fail("period_s", fmt::format("is {} pose commands at {} a second, expected a whole number of them",
                                            poses, s.pose_rate_hz));
    table->finish();
}

void read_model_error(TableReader& root, ModelError& m) {
    auto table = root.table("model_error");
    if (!table) return;
    for (const ModelErrorName& name : kModelErrors) {
        double value = 0;
        table->read(name.name, value);
        m.error.*name.field = name.unit * value;
    }
    table->read("told", m.told);
    table->finish();
}

void read_control(TableReader& root, Control& c) {
    auto table = root.table("control");
    if (!table) return;
    table->read("bandwidth_rad_s", c.bandwidth_rad_s);
    table->read("attitude_bandwidth_rad_s", c.attitude_bandwidth_rad_s);
    table->read("damping", c.damping);
    table->read("retreat_m_s", c.retreat_m_s);
    table->read("turn_deg_s", c.turn_deg_s);
    table->finish();
}

}  // namespace

constinit const TableKeys kLegKeys{.rows = kLegRows}, kNavigationKeys{.rows = kNavigationRows},
    kModelErrorKeys{.rows = kModelErrorRows}, kControlKeys{.rows = kControlRows};

void read_flight(TableReader& root, Scenario& s, const Scene& scene) {
    read_legs(root, s.legs);
    read_navigation(root, s, scene);
    read_model_error(root, s.model_error);
    read_control(root, s.control);
}

}  // namespace narpa::rehearsal
