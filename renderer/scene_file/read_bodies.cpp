#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/constants.h"
#include "renderer/ephemeris/iau_rotation.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/scene_file/trajectory_bodies.h"

namespace narpa {

namespace {

/// CAN identifiers: each body has sixteen, from a base that is a multiple of 16.
constexpr std::int64_t kIdsPerBody = 16, kLastBaseId = 0x5f0;
constexpr std::uint32_t kSyncIdentifier = 0x080;  // CiA 301

constexpr TableKey kBodyRows[]{
    kNameRow,
    {"mesh", rows::file()},
    {"dem", rows::or_file(rows::table(kDemKeys))},
    {"scale", rows::number({.low = 0, .high = 1e12, .low_open = true})},
    {"crease_angle_deg", rows::number({.low = 0, .high = 180})},
    kPositionRow,
    kAttitudeRow,
    {"velocity_m_s", rows::vec3()},
    {"orbit", rows::table(kOrbitKeys)},
    {"rate_rad_s", rows::vec3()},
    {"rotation", rows::choice<kRotatingBodies>()},
    {"trajectory", rows::file()},
    {"can_id", rows::integer(0, kLastBaseId)},
    {"can_pose", rows::table(kCanPoseKeys)},
    {"material", rows::table(kMaterialKeys)},
    {"mark", rows::tables(kMarkKeys)},
};

NamedMesh named_mesh(TableReader& table, const std::string& file, std::optional<int> material,
                     const SceneReading& reading) {
    if (file.empty()) table.fail("mesh", "expected the name of a mesh file");
    return {.body = reading.scene.bodies.size(),
            .path = (reading.folder / file).string(),
            .scale = table.number("scale").value_or(1),
            .crease_rad = kRadPerDeg * table.number("crease_angle_deg").value_or(0),
            .material = material,
            .place = table.place("mesh")};
}

/// Records a problem unless the body has exactly one shape.
void check_one_shape(TableReader& table) {
    std::vector<std::string_view> keys{"mesh"};
    std::string shapes = "mesh = \"FILE\"";
    for (const ShapeKind* kind : shape_kinds()) {
        keys.push_back(kind->name);
        shapes += fmt::format(" or {} = {}", kind->name, kind->example);
    }
    keys.push_back("dem");
    std::string_view first;
    for (const std::string_view key : keys) {
        if (!table.has(key)) continue;
        if (!first.empty())
            table.fail(key, fmt::format("this body has a {} already, expected one of the two", first));
        if (first.empty()) first = key;
    }
    if (first.empty()) table.require("mesh", shapes + " or dem = \"FILE\"");
}

void read_shape(TableReader& table, Body& body, SceneReading& reading) {
    const std::optional<int> own = read_material(table, body.name, reading);
    const auto material = [&] { return own ? *own : add_grey_material(body.name, reading.scene); };
    const auto mesh = table.text("mesh");
    auto exact = read_exact_shape(table);
    check_one_shape(table);
    if (!table.has("mesh")) {
        table.refuse("scale", "belongs to a mesh; other shapes have their size in metres");
        table.refuse("crease_angle_deg", "belongs to a mesh");
    }
    if (mesh) {
        reading.meshes.push_back(named_mesh(table, *mesh, own, reading));
    } else if (exact) {
        exact->material = material();
        body.shape = *std::move(exact);
    } else if (table.has("dem")) {
        read_dem(table, material(), reading);
    }
}

void read_can_id(TableReader& table, Body& body, const Scene& scene) {
    const auto id = table.integer("can_id");
    if (!id) return;
    if (*id % kIdsPerBody != 0) {
        table.fail("can_id",
                   fmt::format("0x{:03x} is not a base identifier, expected a multiple of 16: a body takes "
                               "sixteen identifiers from there",
                               *id));
        return;
    }
    body.can_id = static_cast<std::uint32_t>(*id);
    const auto refuse_sender_of = [&](const char* key, std::int64_t period_ns, std::uint32_t taken) {
        if (period_ns > 0 && taken / kIdsPerBody == *body.can_id / kIdsPerBody)
            table.fail("can_id",
                       fmt::format("0x{:03x} has the identifier 0x{:03x} of {} in [can], expected another", *id,
                                   taken, key));
    };
    refuse_sender_of("sync_period_s", scene.can.sync_period_ns, kSyncIdentifier);
    refuse_sender_of("time_period_s", scene.can.time_period_ns, scene.can.time_id);
    for (const Body& other : scene.bodies)
        if (other.can_id == body.can_id)
            table.fail("can_id",
                       fmt::format("0x{:03x} is taken by body \"{}\", expected one of its own", *id, other.name));
}

/// Attitude and rate of a planet, moon or asteroid at the scene's epoch.
void read_rotation(TableReader& table, Motion& motion, const SceneReading& reading) {
    const auto name = table.text("rotation");
    if (!name) return;
    for (const char* key : {"attitude_wxyz", "rate_rad_s"}) table.refuse(key, "follows from rotation");
    if (!reading.has_epoch) table.fail("rotation", "expected an epoch in [scene], at which the body stands");
    if (const auto turning = body_rotation_of(*name, reading.scene.epoch_unix_ns)) {
        motion.T_world_body.q = turning->q_icrs_body;
        motion.rate_rad_s = turning->rate_rad_s;
        return;
    }
    table.fail("rotation", fmt::format("\"{}\" is not known here, expected one of {}", *name,
                                       fmt::join(kRotatingBodies, ", ")));
}

void read_motion(TableReader& table, Motion& motion) {
    table.read("position_m", motion.T_world_body.t);
    table.read("attitude_wxyz", motion.T_world_body.q);
    table.read("velocity_m_s", motion.velocity_m_s);
    table.read("rate_rad_s", motion.rate_rad_s);
}

/// One body for each name, alike but for the motion. Their mesh is the last of `reading.meshes`, if these have
/// become more.
void add_bodies(const std::vector<NamedCourse>& all, const Body& alike, std::size_t meshes, SceneReading& reading) {
    const bool has_mesh = reading.meshes.size() > meshes;
    for (std::size_t i = 0; i < all.size(); ++i) {
        if (has_mesh && i > 0) {
            NamedMesh mesh = reading.meshes.back();
            mesh.body = reading.scene.bodies.size();
            reading.meshes.push_back(std::move(mesh));
        }
        Body& body = reading.scene.bodies.emplace_back(alike);
        body.name = all[i].name;
        if (!all[i].course) continue;
        body.course = all[i].course;
        body.initial = body.course->at(0);
    }
}

}  // namespace

constinit const TableKeys kBodyKeys{.rows = kBodyRows, .parts = {&kShapeKeys}};

void read_bodies(TableReader& root, SceneReading& reading) {
    TakenNames names;
    TrajectoryFiles trajectories(reading);
    for (TableReader& table : root.tables("body")) {
        const std::vector<NamedCourse> all = read_named_courses(table, names, trajectories);
        Body body;
        if (!all.empty()) body.name = all.front().name;
        const std::size_t meshes = reading.meshes.size();
        read_shape(table, body, reading);
        read_motion(table, body.initial);
        read_rotation(table, body.initial, reading);
        read_orbit(table, body);
        read_can_id(table, body, reading.scene);
        read_can_pose(table, body, reading);
        read_marks(table, body);
        table.finish();
        add_bodies(all, body, meshes, reading);
    }
}

}  // namespace narpa
