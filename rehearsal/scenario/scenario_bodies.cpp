// The two bodies, their orbit and their start.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rehearsal/scenario/scenario_tables.h"

namespace narpa::rehearsal {
namespace {

/// Twice the rate of an orbit just above a body of 22 g/cm^3, denser than any known.
constexpr double kFastestOrbit_rad_s = 5e-3;

constexpr TableKey kOrbitRows[]{
    {"model", rows::kind("clohessy-wiltshire")},
    {"radius_m", rows::number(kPositive)},
    {"mu_m3_s2", rows::number(kPositive)},
    {"up", rows::direction()},
};
constexpr TableKey kCircularRows[]{
    {"along", rows::direction(), {}, "belongs to orbits, [orbit] has model \"surface\""}};
constexpr std::string_view kOfSurface = "belongs to model \"surface\"";
constexpr TableKey kSurfaceRows[]{
    {"axis", rows::direction(), {}, kOfSurface},
    {"rotation_rad_s", rows::number(kNotNegative), {}, kOfSurface},
    {"j2", rows::number(), {}, kOfSurface},
    {"equatorial_radius_m", rows::number(kPositive), {}, kOfSurface},
};

std::vector<TableKind> kinds_of_orbits() {
    std::vector<TableKind> kinds;
    for (const OrbitModel& model : orbit_models()) {
        kinds.push_back({model.name, kCircularRows});
        if (model.over_ground) kinds.back().rows = kSurfaceRows;
    }
    return kinds;
}

constexpr TableKey kPortRows[]{{"position_m", rows::vec3()}, {"attitude_wxyz", rows::attitude()}};
constexpr TableKeys kPortKeys{.rows = kPortRows};
constexpr TableKey kBodyName{"body", rows::text(), "the name of a body of the scene"};
constexpr TableKey kVehicleRows[]{
    kBodyName,
    {"centre_of_mass_m", rows::vec3()},
    {"port", rows::table(kPortKeys)},
    {"mass_kg", rows::number(kPositive)},
    {"inertia_kg_m2", rows::vec3(kPositive)},
};
constexpr TableKey kTargetRows[]{{"with_lvlh", rows::boolean()}, {"rate_deg_s", rows::vec3()}};
constexpr TableKey kAttractorRows[]{kBodyName};
constexpr TableKey kStartRows[]{
    {"position_m", rows::vec3()},   {"position_sigma_m", rows::vec3(kNotNegative)},
    {"velocity_m_s", rows::vec3()}, {"velocity_sigma_m_s", rows::vec3(kNotNegative)},
    {"attitude_deg", rows::vec3()}, {"attitude_sigma_deg", rows::vec3(kNotNegative)},
    {"rate_deg_s", rows::vec3()},   {"rate_sigma_deg_s", rows::vec3(kNotNegative)},
};

const Body* body_named(const Scene& scene, const std::string& name) {
    const auto body = std::ranges::find(scene.bodies, name, &Body::name);
    return body == scene.bodies.end() ? nullptr : &*body;
}

Rigid3 read_port(TableReader& table) {
    Rigid3 T;
    if (auto port = table.table("port")) {
        port->read("position_m", T.t);
        port->read("attitude_wxyz", T.q);
        port->finish();
    }
    return T;
}

void read_orbit(TableReader& root, Orbit& orbit) {
    auto table = root.table("orbit");
    if (!table) return;
    if (const auto kind = table->kind()) orbit.model = &orbit_models()[*kind];
    table->read("radius_m", orbit.radius_m);
    table->read("mu_m3_s2", orbit.mu_m3_s2);
    orbit.up = table->direction("up").value_or(orbit.up);
    if (orbit.model->over_ground) {
        orbit.axis = table->direction("axis").value_or(orbit.axis);
        table->read("rotation_rad_s", orbit.rotation_rad_s);
        table->read("j2", orbit.j2);
        orbit.equatorial_radius_m = table->number("equatorial_radius_m").value_or(orbit.radius_m);
    } else {
        orbit.along = table->direction("along").value_or(orbit.along);
        if (std::abs(dot(orbit.up, orbit.along)) > 1e-6)
            table->fail("along", "expected a direction at right angles to `up`: the orbit is circular");
    }
    if (!(orbit.rate_rad_s() <= kFastestOrbit_rad_s))
        table->fail("radius_m", fmt::format("with mu_m3_s2 = {:g} it turns at {:.3g} rad/s, expected at most {:g}",
                                            orbit.mu_m3_s2, orbit.rate_rad_s(), kFastestOrbit_rad_s));
    table->finish();
}

/// Returns the table's reader: the target has more keys.
std::optional<TableReader> read_vehicle(TableReader& root, std::string_view name, const Scene& scene, Vehicle& v) {
    auto table = root.table(name);
    if (!table) return table;
    table->read("body", v.body);
    table->read("centre_of_mass_m", v.centre_of_mass_m);
    v.T_body_port = read_port(*table);
    table->read("mass_kg", v.mass_kg);
    const Vec3 inertia = table->vec3("inertia_kg_m2").value_or(Vec3{1, 1, 1});
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
    table->read("with_lvlh", s.target_motion.with_lvlh);
    table->read("rate_deg_s", s.target_motion.rate_deg_s);
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
    const auto with_sigma = [&](std::string_view key, std::string_view sigma_key, Vec3& value, Vec3& sigma) {
        table->read(key, value);
        table->read(sigma_key, sigma);
    };
    with_sigma("position_m", "position_sigma_m", start.position_m, start.position_sigma_m);
    with_sigma("velocity_m_s", "velocity_sigma_m_s", start.velocity_m_s, start.velocity_sigma_m_s);
    with_sigma("attitude_deg", "attitude_sigma_deg", start.attitude_deg, start.attitude_sigma_deg);
    with_sigma("rate_deg_s", "rate_sigma_deg_s", start.rate_deg_s, start.rate_sigma_deg_s);
    table->finish();
}

}  // namespace

constinit const TableKeys kOrbitKeys{.rows = kOrbitRows, .kinds = kinds_of_orbits},
    kChaserKeys{.rows = kVehicleRows}, kTargetKeys{.rows = kTargetRows, .parts = {&kChaserKeys}},
    kAttractorKeys{.rows = kAttractorRows}, kStartKeys{.rows = kStartRows};

void read_bodies(TableReader& root, Scenario& s, const Scene& scene) {
    read_orbit(root, s.orbit);
    read_target(root, s, scene);
    read_chaser(root, s, scene);
    read_attractor(root, s, scene);
    read_start(root, s.start);
}

}  // namespace narpa::rehearsal
