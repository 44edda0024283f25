#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "protocols/lidar/lidar_model.h"
#include "rehearsal/scenario/scenario_tables.h"
#include "renderer/keys/toml_file.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa::rehearsal {
namespace {

constexpr double kLongest_s = 1e6;
/// Twice the rate of an orbit just above a body of 22 g/cm^3, denser than any known.
constexpr double kFastestOrbit_rad_s = 5e-3;

const Body* body_named(const Scene& scene, const std::string& name) {
    const auto body = std::ranges::find(scene.bodies, name, &Body::name);
    return body == scene.bodies.end() ? nullptr : &*body;
}

Rigid3 read_port(TableReader& table) {
    Rigid3 T;
    if (auto port = table.table("port")) {
        T.t = port->vec3("position_m").value_or(Vec3{});
        T.q = port->attitude("attitude_wxyz").value_or(Quat{});
        port->finish();
    }
    return T;
}

void read_orbit(TableReader& root, Orbit& orbit) {
    auto table = root.table("orbit");
    if (!table) return;
    std::vector<std::pair<std::string_view, const OrbitModel*>> models;
    for (const OrbitModel& model : orbit_models()) models.emplace_back(model.name, &model);
    orbit.model = table->choice<const OrbitModel*>("model", models).value_or(orbit.model);
    read(*table, "radius_m", orbit.radius_m, kPositive);
    read(*table, "mu_m3_s2", orbit.mu_m3_s2, kPositive);
    orbit.up = table->direction("up").value_or(orbit.up);
    orbit.along = table->direction("along").value_or(orbit.along);
    if (orbit.model->over_ground) {
        orbit.axis = table->direction("axis").value_or(orbit.axis);
        read(*table, "rotation_rad_s", orbit.rotation_rad_s, kNotNegative);
        read(*table, "j2", orbit.j2);
        orbit.equatorial_radius_m = table->number("equatorial_radius_m", kPositive).value_or(orbit.radius_m);
        table->refuse("along", "belongs to orbits, [orbit] has model \"surface\"");
    } else {
        for (const char* key : {"axis", "rotation_rad_s", "j2", "equatorial_radius_m"})
            table->refuse(key, "belongs to model \"surface\"");
    }
    if (!orbit.model->over_ground && std::abs(dot(orbit.up, orbit.along)) > 1e-6)
        table->fail("along", "expected a direction at right angles to `up`: the orbit is circular");
    if (!(orbit.rate_rad_s() <= kFastestOrbit_rad_s))
        table->fail("radius_m", fmt::format("with mu_m3_s2 = {:g} it turns at {:.3g} rad/s, expected at most {:g}",
                                            orbit.mu_m3_s2, orbit.rate_rad_s(), kFastestOrbit_rad_s));
    table->finish();
}

/// Returns the table's reader: the target has more keys.
std::optional<TableReader> read_vehicle(TableReader& root, const char* name, const Scene& scene, Vehicle& v) {
    root.require(name, fmt::format("a table [{}]", name));
    auto table = root.table(name);
    if (!table) return table;
    table->require("body", "the name of a body of the scene");
    v.body = table->text("body").value_or("");
    read(*table, "centre_of_mass_m", v.centre_of_mass_m);
    v.T_body_port = read_port(*table);
    read(*table, "mass_kg", v.mass_kg, kPositive);
    const Vec3 inertia = table->vec3("inertia_kg_m2", kPositive).value_or(Vec3{1, 1, 1});
    v.inertia_kg_m2 = Eigen::Vector3d(inertia.x, inertia.y, inertia.z).asDiagonal();
    const double largest = std::max({inertia.x, inertia.y, inertia.z});
    if (2 * largest > inertia.x + inertia.y + inertia.z)
        table->fail("inertia_kg_m2", "no moment may exceed the sum of the two others");
    const Body* body = body_named(scene, v.body);
    if (table->has("body") && !body) {
        table->fail("body", fmt::format("\"{}\" is no body of {}", v.body, scene.file));
    } else if (body) {
        if (!body->can_id)
            table->fail("body", fmt::format("\"{}\" has no can_id in {}, expected one: its pose is commanded",
                                            v.body, scene.file));
        v.can_id = body->can_id.value_or(0);
    }
    return table;
}

void read_target(TableReader& root, Scenario& s, const Scene& scene) {
    auto table = read_vehicle(root, "target", scene, s.target);
    if (!table) return;
    if (const Body* body = body_named(scene, s.target.body)) s.q_world_target = body->initial.T_world_body.q;
    read(*table, "with_lvlh", s.target_motion.with_lvlh);
    read(*table, "rate_deg_s", s.target_motion.rate_deg_s);
    table->finish();
}

void read_chaser(TableReader& root, Scenario& s, const Scene& scene) {
    auto table = read_vehicle(root, "chaser", scene, s.chaser);
    if (!table) return;
    if (!s.chaser.body.empty() && s.chaser.body == s.target.body)
        table->fail("body", "is the target too, expected another body");
    table->finish();
}

void read_attractor(TableReader& root, Scenario& s, const Scene& scene) {
    auto table = root.table("attractor");
    if (!table) return;
    table->require("body", "the name of a body of the scene");
    const std::string name = table->text("body").value_or("");
    if (const Body* body = body_named(scene, name); body && body->can_id) {
        s.attractor.emplace(name, *body->can_id);
        s.q_world_attractor = body->initial.T_world_body.q;
    }
    if (table->has("body") && !s.attractor)
        table->fail("body", fmt::format("\"{}\" is no body with a can_id of {}", name, scene.file));
    if (!s.orbit.model->has_attractor && !s.orbit.model->over_ground)
        table->fail("body", "[orbit] has model \"free\", expected none: nothing attracts");
    if (s.orbit.model->over_ground)
        table->fail("body", "[orbit] has model \"surface\", expected none: the target is the attractor's ground");
    if (s.attractor && !s.orbit.model->over_ground && (name == s.target.body || name == s.chaser.body))
        table->fail("body", fmt::format("is the {} too, expected another body",
                                        name == s.target.body ? "target" : "chaser"));
    table->finish();
}

void read_start(TableReader& root, Start& start) {
    auto table = root.table("start");
    if (!table) return;
    const auto with_sigma = [&](const char* key, const char* sigma_key, Vec3& value, Vec3& sigma) {
        read(*table, key, value);
        read(*table, sigma_key, sigma, kNotNegative);
    };
    with_sigma("position_m", "position_sigma_m", start.position_m, start.position_sigma_m);
    with_sigma("velocity_m_s", "velocity_sigma_m_s", start.velocity_m_s, start.velocity_sigma_m_s);
    with_sigma("attitude_deg", "attitude_sigma_deg", start.attitude_deg, start.attitude_sigma_deg);
    with_sigma("rate_deg_s", "rate_sigma_deg_s", start.rate_deg_s, start.rate_sigma_deg_s);
    table->finish();
}

void read_actuators(TableReader& root, Scenario& s) {
    if (auto table = root.table("thrusters")) {
        Thrusters& t = s.thrusters;
        read(*table, "force_n", t.force_n, kPositive);
        read(*table, "torque_n_m", t.torque_n_m, kPositive);
        read(*table, "min_on_s", t.min_on_s, kNotNegative);
        read(*table, "gain_sigma", t.gain_sigma, {.low = 0, .high = 0.5});
        read(*table, "misalignment_sigma_deg", t.misalignment_sigma_deg, {.low = 0, .high = 20});
        table->finish();
    }
    if (auto table = root.table("engine")) s.engine = read_engine(*table);
    if (auto table = root.table("landing_gear")) s.gear = read_gear(*table, s);
    if (auto table = root.table("attitude_sensor")) {
        AttitudeSensor& a = s.attitude_sensor;
        read(*table, "attitude_sigma_deg", a.attitude_sigma_deg, kNotNegative);
        read(*table, "rate_sigma_deg_s", a.rate_sigma_deg_s, kNotNegative);
        table->finish();
    }
}

void read_legs(TableReader& root, std::vector<Leg>& legs) {
    auto tables = root.tables("leg");
    if (tables.empty()) root.require("leg", "[[leg]], one at least");
    for (TableReader& table : tables) {
        Leg leg;
        leg.name = table.text("name").value_or(fmt::format("leg {}", legs.size() + 1));
        leg.arc_deg = table.number("arc_deg", {.low = -3600, .high = 3600});
        leg.descent_s = table.number("descent_s", kPositive);
        if (leg.descent_s) {
            read(table, "end_velocity_m_s", leg.end_velocity_m_s);
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
            read(table, "to_m", leg.to_m);
        }
        read(table, "speed_m_s", leg.speed_m_s, kPositive);
        read(table, "hold_s", leg.hold_s, {.low = 0, .high = kLongest_s});
        read(table, "within_m", leg.within_m, kPositive);
        read(table, "contact", leg.contact);
        read(table, "look_at_target", leg.look_at_target);
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

/// Reads the map: another scene with the same bodies and sensors, of which only the shapes differ.
std::string read_map(TableReader& table, const Scene& scene) {
    const auto map = table.text("map");
    if (!map) return "";
    std::string path = beside(table.place("map").file, *map);
    const auto known = read_scene(path);
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
    root.require("navigation", "a table [navigation]");
    auto table = root.table("navigation");
    if (!table) return;
    Navigation& n = s.navigation;
    n.cameras = read_sensors(*table, "cameras", scene.cameras, scene, s.chaser.body);
    std::vector<std::pair<std::string_view, const CameraMethod*>> methods;
    for (const CameraMethod& m : camera_methods()) methods.emplace_back(m.name, &m);
    n.camera_method = table->choice<const CameraMethod*>("camera_method", methods).value_or(n.camera_method);
    n.lidars = read_sensors(*table, "lidars", scene.lidars, scene, s.chaser.body);
    n.velocimeters = read_velocimeters(*table, scene, s.chaser.body);
    const bool over_ground = s.orbit.model->over_ground && !n.velocimeters.empty();
    if (n.cameras.empty() && n.lidars.empty() && !over_ground)
        table->fail(table->has("lidars") ? "lidars" : "cameras",
                    "no sensor, expected a camera or a LiDAR to navigate by");
    n.scene = read_map(*table, scene);
    read(*table, "map_sigma_m", n.map_sigma_m, kNotNegative);
    read(*table, "map_correlation_m", n.map_correlation_m, kNotNegative);
    read(*table, "period_s", n.period_s, {.low = 0.01, .high = 100});
    read(*table, "acceleration_psd", n.acceleration_psd, kPositive);
    read(*table, "angular_acceleration_psd", n.angular_acceleration_psd, kPositive);
    read(*table, "abort_sigma_m", n.abort_sigma_m, kPositive);
    read(*table, "abort_lost_s", n.abort_lost_s, kPositive);
    read(*table, "abort_off_m", n.abort_off_m, kPositive);
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
        read(*table, name.name.data(), value, kNotNegative);
        m.error.*name.field = name.unit * value;
    }
    read(*table, "told", m.told, kNotNegative);
    table->finish();
}

void read_control(TableReader& root, Control& c) {
    auto table = root.table("control");
    if (!table) return;
    read(*table, "bandwidth_rad_s", c.bandwidth_rad_s, kPositive);
    read(*table, "attitude_bandwidth_rad_s", c.attitude_bandwidth_rad_s, kPositive);
    read(*table, "damping", c.damping, {.low = 0.1, .high = 10});
    read(*table, "retreat_m_s", c.retreat_m_s, kPositive);
    read(*table, "turn_deg_s", c.turn_deg_s, kPositive);
    table->finish();
}

void read_contact(TableReader& gates, Gates& out) {
    auto table = gates.table("contact");
    if (!table) return;
    CaptureEnvelope c;
    read(*table, "closing_min_m_s", c.closing_min_m_s, kNotNegative);
    read(*table, "closing_max_m_s", c.closing_max_m_s, kNotNegative);
    if (!(c.closing_min_m_s < c.closing_max_m_s))
        table->fail("closing_min_m_s", fmt::format("is {:g}, expected less than closing_max_m_s, {:g}",
                                                   c.closing_min_m_s, c.closing_max_m_s));
    read(*table, "lateral_rate_m_s", c.lateral_rate_m_s, kNotNegative);
    read(*table, "lateral_m", c.lateral_m, kNotNegative);
    read(*table, "pitch_yaw_deg", c.pitch_yaw_deg, kNotNegative);
    read(*table, "roll_deg", c.roll_deg, kNotNegative);
    read(*table, "pitch_yaw_rate_deg_s", c.pitch_yaw_rate_deg_s, kNotNegative);
    read(*table, "roll_rate_deg_s", c.roll_rate_deg_s, kNotNegative);
    table->finish();
    out.contact = c;
}

void read_gates(TableReader& root, Scenario& s) {
    auto table = root.table("gates");
    if (!table) return;
    Gates& g = s.gates;
    if (auto corridor = table->table("corridor")) {
        Gates::Corridor c;
        read(*corridor, "half_angle_deg", c.half_angle_deg, {.low = 0, .high = 90});
        read(*corridor, "radius_m", c.radius_m, kNotNegative);
        read(*corridor, "from_m", c.from_m, kPositive);
        corridor->finish();
        g.corridor = c;
    }
    g.keep_out_m = table->number("keep_out_m", kPositive);
    if (g.keep_out_m && !g.corridor && s.legs.back().contact)
        table->fail("keep_out_m", "nothing may enter this sphere without a corridor, expected `corridor` too");
    if (const auto band = table->pair("distance_m", kNotNegative)) {
        g.distance_m.emplace((*band)[0], (*band)[1]);
        if (!((*band)[0] < (*band)[1])) table->fail("distance_m", "expected [least, most]");
    }
    if (auto navigation = table->table("navigation")) {
        Gates::NavigationError n;
        read(*navigation, "sigmas", n.sigmas, kPositive);
        read(*navigation, "share", n.share, kUnit);
        read(*navigation, "position_m", n.position_m, kPositive);
        read(*navigation, "attitude_deg", n.attitude_deg, kPositive);
        navigation->finish();
        g.navigation = n;
    }
    read_contact(*table, g);
    read_landing(*table, s, g);
    if (g.contact && s.gear) table->fail("contact", "belongs to docking ports, expected `landing`");
    if (g.contact && !s.legs.back().contact)
        table->fail("contact", "no leg has contact = true, expected the last one to have it");
    read(*table, "complete", g.complete);
    table->finish();
}

/// Reads the scenario's scene; null if it cannot be read.
std::optional<Scene> read_head(TableReader& root, Scenario& s, Problems& problems) {
    root.require("scenario", "a table [scenario]");
    auto table = root.table("scenario");
    if (!table) return std::nullopt;
    (void)table->has("based_on");
    std::vector<std::string> names;
    s.name = read_name(*table, names);
    if (s.name.starts_with('.')) table->fail("name", "is that of the results' folder, expected no '.' in front");
    s.title = table->text("title").value_or(s.name);
    read(*table, "duration_s", s.duration_s, {.low = 0, .high = kLongest_s, .low_open = true});
    read(*table, "pose_rate_hz", s.pose_rate_hz, {.low = 0.1, .high = 1000});
    if (const auto seed = table->integer("seed", 0, std::numeric_limits<std::int64_t>::max()))
        s.seed = static_cast<std::uint64_t>(*seed);
    table->require("scene", "the scene file");
    const auto scene = table->text("scene");
    const FilePlace place = table->place("scene");
    table->finish();
    if (!scene) return std::nullopt;
    s.scene = beside(place.file, *scene);
    if (std::error_code error; !std::filesystem::exists(s.scene, error)) {
        problems.add(place, "scene: " + s.scene + ": no such file");
        return std::nullopt;
    }
    auto read = read_scene(s.scene);
    if (read) return *std::move(read);
    problems.add(place, read.error());
    return std::nullopt;
}

void read_root(TableReader& root, Scenario& s, Problems& problems) {
    const std::optional<Scene> scene = read_head(root, s, problems);
    if (!scene) return;
    read_orbit(root, s.orbit);
    read_target(root, s, *scene);
    read_chaser(root, s, *scene);
    read_attractor(root, s, *scene);
    read_start(root, s.start);
    read_actuators(root, s);
    read_legs(root, s.legs);
    read_navigation(root, s, *scene);
    read_model_error(root, s.model_error);
    read_control(root, s.control);
    for (TableReader& table : root.tables("fault"))
        s.faults.push_back(read_fault(table, s.engine.has_value(), s.duration_s));
    if (!s.legs.empty()) read_gates(root, s);
    root.finish();
}

}  // namespace

Result<Scenario> read_scenario(const std::string& path) {
    Scenario s;
    s.file = path;
    Problems problems(path);
    const auto file = TomlFile::read(path, "scenario");
    if (!file) return file.error();
    TableReader root = file->root("the scenario", problems);
    read_root(root, s, problems);
    if (!problems.none()) return problems.first();
    return s;
}

}  // namespace narpa::rehearsal
