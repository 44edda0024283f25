// `dem` of a body: a digital elevation model, read as terrain (docs/terrain.md).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/file_bytes.h"
#include "renderer/assets/dem_process.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr Range kDemFactor{.low = -1e9, .high = 1e9};
constexpr Range kDemLength{.low = 0, .high = 1e9, .low_open = true};
constexpr double kPixelsPerRadWithoutCamera = 1000;

constexpr std::array<std::string_view, 3> kGroundNames{"plane", "ellipsoid", "tangent"};  // of DemRequest::On
constexpr std::array<std::string_view, 2> kHeightNames{"heights", "radii"};
constexpr TableKey kDetailRows[]{
    {"posts", rows::integer(2, 64), "how many times finer than the DEM, 2 to 64"},
    // From 2.4 on, cells would hold more craters than DetailedSource draws.
    {"craters_per_m2", rows::number(kUnit)},
    {"rocks_share", rows::number({.low = 0, .high = 0.5})},
    {"seed", rows::integer(0, 1'000'000'000)},
};
constexpr TableKeys kDetailKeys{.rows = kDetailRows};
constexpr TableKey kDemRows[]{
    {"file", rows::file(), "the name of a DEM"},
    {"on", rows::choice<kGroundNames>()},
    {"has", rows::choice<kHeightNames>()},
    {"scale", rows::number(kDemFactor)},
    {"offset_m", rows::number(kDemFactor)},
    {"no_data", rows::number()},
    {"post_spacing_m", rows::number(kDemLength)},
    {"ellipsoid_m", rows::pair(kDemLength)},
    {"error_px", rows::number({.low = 0.001, .high = 1000})},
    {"error_m", rows::number(kDemLength)},
    {"seen_from_m", rows::points(256)},
    {"budget_mib", rows::integer(1, 1 << 20)},
    {"detail", rows::table(kDetailKeys)},
};

TerrainDetail read_detail(TableReader& table) {
    TerrainDetail d;
    table.read("posts", d.refinement_factor);
    table.read("craters_per_m2", d.craters);
    table.read("rocks_share", d.rocks);
    table.read("seed", d.seed);
    table.finish();
    return d;
}

DemRequest read_request(TableReader& table, const SceneReading& reading) {
    DemRequest r;
    const std::string file = table.text("file").value_or("");
    if (table.has("file") && file.empty()) table.fail("file", "expected the name of a DEM");
    r.path = (reading.folder / file).string();
    table.read("on", r.on);
    r.radii = table.word("has") == 1u;
    table.read("scale", r.scale);
    table.read("offset_m", r.offset_m);
    table.read("no_data", r.no_data);
    table.read("post_spacing_m", r.post_spacing_m);
    if (const auto axes = table.pair("ellipsoid_m")) r.equatorial_m = (*axes)[0], r.polar_m = (*axes)[1];
    table.read("error_px", r.options.error_px);
    table.read("error_m", r.options.error_m);
    r.options.seen_from = table.points("seen_from_m").value_or(std::vector<Vec3>{});
    r.options.budget_bytes = static_cast<std::uint64_t>(table.integer("budget_mib").value_or(1024)) << 20;
    if (auto detail = table.table("detail")) r.detail = read_detail(*detail);
    table.finish();
    return r;
}

Rigid3 initial_pose(int mount, const Scene& scene) {
    return mount < 0 ? Rigid3{} : scene.bodies[static_cast<std::size_t>(mount)].initial.T_world_body;
}

/// Where the scene's sensors are at time 0, in the body's frame.
std::vector<Vec3> places_of_sensors(const Scene& scene, std::size_t body) {
    const Rigid3 T_body_world = inverse(scene.bodies[body].initial.T_world_body);
    std::vector<Vec3> places;
    for (const Camera& c : scene.cameras)
        places.push_back(T_body_world * (initial_pose(c.mount, scene) * c.T_mount_camera.t));
    for (const Lidar& l : scene.lidars)
        places.push_back(T_body_world * (initial_pose(l.mount, scene) * l.T_mount_lidar.t));
    return places;
}

/// Pixels per radian in the corner of the image, where a pinhole has most.
double pixels_per_rad(const Camera& c) {
    const Pinhole p = paraxial_pinhole(*c.model);
    const double f = std::max(p.fx, p.fy), x = std::max(p.cx, c.width - 1 - p.cx) / p.fx,
                 y = std::max(p.cy, c.height - 1 - p.cy) / p.fy;
    return c.model->pinhole() == nullptr ? f : f * (1 + x * x + y * y);
}

bool is_moving(int mount, const Scene& scene) {
    if (mount < 0) return false;
    const Body& b = scene.bodies[static_cast<std::size_t>(mount)];
    return b.can_id.has_value() || norm(b.initial.velocity_m_s) > 0;
}

void take_sensors(DemRequest& r, std::size_t body, Scene& scene) {
    double sharpest = 0;
    for (const Camera& c : scene.cameras) sharpest = std::max(sharpest, pixels_per_rad(c));
    r.options.pixels_per_rad = sharpest > 0 ? sharpest : kPixelsPerRadWithoutCamera;
    if (!r.options.seen_from.empty()) return;
    r.options.seen_from = places_of_sensors(scene, body);
    const auto any_is_moving = [&](const auto& sensors) {
        return std::any_of(sensors.begin(), sensors.end(),
                           [&](const auto& s) { return is_moving(s.mount, scene); });
    };
    if (any_is_moving(scene.cameras) || any_is_moving(scene.lidars) || is_moving(static_cast<int>(body), scene))
        scene.warnings.push_back(
            fmt::format("body \"{}\": the terrain is as fine as the places of the sensors at time 0 need it; "
                        "seen_from_m in its "
                        "dem names the path that they will take",
                        scene.bodies[body].name));
}

void load_dem(const NamedDem& named, SceneReading& reading) {
    Scene& scene = reading.scene;
    DemRequest request = named.request;
    if (const Status plain = check_plain_file(request.path); !plain)
        return reading.problems.add(named.place, "dem: " + plain.error().text());
    take_sensors(request, named.body, scene);
    Result<TerrainMesh> terrain = read_dem_in_process(request);
    if (!terrain) return reading.problems.add(named.place, "dem: " + terrain.error().text());
    for (const std::string& warning : terrain->warnings)
        scene.warnings.push_back(fmt::format("{}: {}", request.path, warning));
    if (terrain->summary.error_px > request.options.error_px)
        scene.warnings.push_back(fmt::format(
            "{}: a budget of {} MiB keeps the error of the terrain within {:.2g} px, not {:.2g} px", request.path,
            request.options.budget_bytes >> 20, terrain->summary.error_px, request.options.error_px));
    Mesh mesh;
    mesh.name = request.path;
    mesh.height_field = true;
    mesh.origin_m = terrain->origin_m;
    mesh.positions = std::move(terrain->positions), mesh.normals = std::move(terrain->normals);
    mesh.uvs = std::move(terrain->uvs), mesh.faces = std::move(terrain->faces);
    mesh.face_material.assign(mesh.faces.size(), static_cast<std::uint16_t>(named.material));
    scene.bodies[named.body].shape = static_cast<int>(scene.meshes.size());
    scene.meshes.push_back(std::move(mesh));
}

}  // namespace

constinit const TableKeys kDemKeys{.rows = kDemRows};

void read_dem(TableReader& body, int material, SceneReading& reading) {
    NamedDem named{
        .body = reading.scene.bodies.size(), .request = {}, .material = material, .place = body.place("dem")};
    if (body.is_text("dem")) {
        named.request.path = (reading.folder / body.text("dem").value_or("")).string();
    } else if (auto table = body.table("dem")) {
        named.request = read_request(*table, reading);
    }
    reading.dems.push_back(std::move(named));
}

void load_dems(SceneReading& reading) {
    for (const NamedDem& named : reading.dems) load_dem(named, reading);
}

}  // namespace narpa
