#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "base/constants.h"
#include "renderer/assets/calibration_file.h"
#include "renderer/projection/projection_kind.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr std::array kKeys{"intrinsics", "fov_diagonal_deg", "fov_horizontal_deg", "calibration"};

/// The kinds that have a name of this sort.
template <std::string_view ProjectionKind::*name>
std::vector<TableKind> named_projections() {
    std::vector<TableKind> kinds;
    for (const ProjectionKind* kind : projection_kinds())
        if (!(kind->*name).empty()) kinds.push_back({kind->*name, kind->keys});
    return kinds;
}

constexpr TableKey kIntrinsicsRows[]{
    {"fx", rows::number(kPositive), "a focal length in pixels"},
    {"fy", rows::number(kPositive), "a focal length in pixels"},
    {"cx", rows::number()},
    {"cy", rows::number()},
};
constexpr TableKey kProjectionKindRows[]{{"kind", rows::kind(), "the name of a projection"}};
constexpr TableKey kDistortionRows[]{{"model", rows::kind(), "\"opencv\" or \"fisheye\""}};
constexpr TableKeys kIntrinsicsKeys{.rows = kIntrinsicsRows};
constexpr TableKeys kProjectionKindKeys{.rows = kProjectionKindRows,
                                        .kinds = named_projections<&ProjectionKind::name>};
constexpr TableKeys kDistortionKeys{.rows = kDistortionRows, .kinds = named_projections<&ProjectionKind::opencv>};
/// The kind of projection narrows it.
constexpr Range kFieldOfView{.low = 0, .high = 360, .low_open = true, .high_open = true};
constexpr TableKey kProjectionRows[]{
    {"resolution", rows::size(kMaxPixelsPerSide)},
    {"intrinsics", rows::table(kIntrinsicsKeys)},
    {"fov_diagonal_deg", rows::number(kFieldOfView)},
    {"fov_horizontal_deg", rows::number(kFieldOfView)},
    {"calibration", rows::file()},
    {"projection", rows::table(kProjectionKindKeys)},
    {"distortion", rows::table(kDistortionKeys)},
};

void read_intrinsics(TableReader& table, Pinhole& pinhole) {
    table.read("fx", pinhole.fx);
    table.read("fy", pinhole.fy);
    table.read("cx", pinhole.cx);
    table.read("cy", pinhole.cy);
    table.finish();
}

/// A pinhole where there is no such table.
ProjectionParameters read_kind(TableReader& camera, const char* key, const TableKeys& keys,
                               const ProjectionKind* (*kind_of)(std::string_view name)) {
    ProjectionParameters p{&kPinhole};
    auto table = camera.table(key);
    if (!table) return p;
    if (const auto kind = table->kind()) p.kind = kind_of(keys.kinds()[*kind].name);
    p.values = table->values(p.kind->keys, 0);
    table->finish();
    return p;
}

ProjectionParameters read_projection_kind(TableReader& camera) {
    if (!camera.has("projection")) return read_kind(camera, "distortion", kDistortionKeys, opencv_kind);
    camera.refuse("distortion", "there is a projection already, expected one of the two");
    return read_kind(camera, "projection", kProjectionKindKeys, projection_kind);
}

/// The focal length with which the image spans `angle` from edge to edge along the unit image direction (x, y),
/// over `extent_px`. 0 where the lens does not see so wide.
double focal_length(ProjectionParameters p, double angle, double x, double y, double extent_px) {
    p.pinhole = {1, 1, 0, 0};
    const auto model = make_projection(p);
    const Vec3 to_side = std::sin(0.5 * angle) * Vec3{x, y, 0}, forward{0, 0, std::cos(0.5 * angle)};
    const auto one = model->project(forward + to_side), other = model->project(forward - to_side);
    if (!one || !other) return 0;
    const double extent = std::hypot(one->x - other->x, one->y - other->y);
    return extent > 0 ? extent_px / extent : 0;
}

void read_field_of_view(TableReader& table, const Camera& camera, ProjectionParameters& p) {
    Range angle = kFieldOfView;
    angle.high = p.kind->fov_max_deg;
    const double diagonal_px = std::hypot(camera.width, camera.height);
    const auto take = [&](const char* key, double x, double y, double extent_px) {
        const auto deg = table.number(key, angle);
        if (!deg) return;
        const double f = focal_length(p, *deg * kPi / 180, x, y, extent_px);
        if (f == 0)
            return table.fail(key, fmt::format("the lens does not see {} degrees: beyond some angle the distortion "
                                               "would fold the image; expected less",
                                               *deg));
        p.pinhole.fx = p.pinhole.fy = f;
    };
    take("fov_diagonal_deg", camera.width / diagonal_px, camera.height / diagonal_px, diagonal_px);
    take("fov_horizontal_deg", 1, 0, camera.width);
}

/// Size and projection from a file.
void read_calibration_key(TableReader& table, Camera& camera, const std::filesystem::path& folder,
                          std::vector<std::string>& warnings) {
    const auto name = table.text("calibration");
    if (!name) return;
    for (const char* key : {"distortion", "projection"})
        table.refuse(key, "the calibration has one, expected one of the two");
    const Result<Calibration> c = read_calibration((folder / *name).string());
    if (!c) return table.fail("calibration", c.error().text());
    for (const std::string& warning : c->warnings) warnings.push_back(fmt::format("{}: {}", *name, warning));
    if (table.has("resolution") && (camera.width != c->width || camera.height != c->height))
        table.fail("resolution",
                   fmt::format("got {} x {}, expected that of the calibration, {} x {}, or no such key",
                               camera.width, camera.height, c->width, c->height));
    camera.width = c->width, camera.height = c->height, camera.model = c->model;
}

void read_resolution(TableReader& table, Camera& camera) {
    if (!table.has("calibration")) table.require("resolution", "[width, height] in pixels");
    if (const auto size = table.size("resolution")) camera.width = (*size)[0], camera.height = (*size)[1];
}

void check_one_is_given(TableReader& table) {
    const std::string one_of = fmt::format("one of {}", fmt::join(kKeys, ", "));
    const auto given = std::ranges::count_if(kKeys, [&](const char* key) { return table.has(key); });
    if (given == 0) table.require("fov_diagonal_deg", one_of);
    if (given > 1)
        for (const char* key : kKeys)
            if (table.has(key)) table.fail(key, "expected exactly " + one_of);
}

}  // namespace

constinit const TableKeys kProjectionKeys{.rows = kProjectionRows};

void read_projection(TableReader& table, Camera& camera, const std::filesystem::path& folder,
                     std::vector<std::string>& warnings) {
    read_resolution(table, camera);
    ProjectionParameters p = read_projection_kind(table);
    p.pinhole = {1, 1, 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)};
    check_one_is_given(table);
    if (auto intrinsics = table.table("intrinsics")) read_intrinsics(*intrinsics, p.pinhole);
    read_field_of_view(table, camera, p);
    camera.model = make_projection(p);
    read_calibration_key(table, camera, folder, warnings);
    assert(camera.model);
}

}  // namespace narpa
