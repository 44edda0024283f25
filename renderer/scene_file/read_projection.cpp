#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "base/constants.h"
#include "renderer/assets/calibration_file.h"
#include "renderer/projection/kannala_brandt.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr std::array kKeys{"intrinsics", "fov_diagonal_deg", "fov_horizontal_deg", "calibration"};

void read_intrinsics(TableReader& table, Pinhole& pinhole) {
    for (const char* key : {"fx", "fy"}) table.require(key, "a focal length in pixels");
    pinhole.fx = table.number("fx", kPositive).value_or(1);
    pinhole.fy = table.number("fy", kPositive).value_or(1);
    pinhole.cx = table.number("cx").value_or(pinhole.cx);
    pinhole.cy = table.number("cy").value_or(pinhole.cy);
    table.finish();
}

/// `key = {kind_key = ..., parameters}`; a pinhole where there is no such table.
ProjectionParameters read_kind(TableReader& camera, const char* key, const char* kind_key,
                               std::string_view ProjectionKind::*name) {
    ProjectionParameters p{&kPinhole};
    auto table = camera.table(key);
    if (!table) return p;
    std::vector<std::pair<std::string_view, const ProjectionKind*>> kinds;
    for (const ProjectionKind* kind : projection_kinds())
        if (!(kind->*name).empty()) kinds.emplace_back(kind->*name, kind);
    table->require(kind_key, "\"opencv\" or \"fisheye\"");
    p.kind = table->choice<const ProjectionKind*>(kind_key, kinds).value_or(&kPinhole);
    for (const TableKey& row : p.kind->keys) {
        table->require(row.name, row.required);
        if (row.value.type == KeyValue::Type::numbers) {
            p.values = p.kind == &kKannalaBrandt
                           ? table->numbers(row.name, {4}).value_or(std::vector<double>(4))
                           : table->numbers(row.name, {4, 5, 8, 12}).value_or(std::vector<double>(4));
        } else {
            p.values.push_back(table->number(row.name, row.value.range).value_or(0));
        }
    }
    table->finish();
    return p;
}

ProjectionParameters read_projection_kind(TableReader& camera) {
    if (camera.has("projection")) {
        camera.refuse("distortion", "there is a projection already, expected one of the two");
        return read_kind(camera, "projection", "kind", &ProjectionKind::name);
    }
    return read_kind(camera, "distortion", "model", &ProjectionKind::opencv);
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
    const Range angle{.low = 0, .high = p.kind->fov_max_deg, .low_open = true, .high_open = true};
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
void read_calibration_key(TableReader& table, Camera& camera, const std::filesystem::path& folder) {
    const auto name = table.text("calibration");
    if (!name) return;
    for (const char* key : {"distortion", "projection"})
        table.refuse(key, "the calibration has one, expected one of the two");
    const Result<Calibration> c = read_calibration((folder / *name).string());
    if (!c) return table.fail("calibration", c.error().text());
    if (table.has("resolution") && (camera.width != c->width || camera.height != c->height))
        table.fail("resolution",
                   fmt::format("got {} x {}, expected that of the calibration, {} x {}, or no such key",
                               camera.width, camera.height, c->width, c->height));
    camera.width = c->width, camera.height = c->height, camera.model = c->model;
}

void read_resolution(TableReader& table, Camera& camera) {
    if (!table.has("calibration")) table.require("resolution", "[width, height] in pixels");
    if (const auto size = table.size("resolution", kMaxPixelsPerSide))
        camera.width = (*size)[0], camera.height = (*size)[1];
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

void read_projection(TableReader& table, Camera& camera, const std::filesystem::path& folder) {
    read_resolution(table, camera);
    ProjectionParameters p = read_projection_kind(table);
    p.pinhole = {1, 1, 0.5 * (camera.width - 1), 0.5 * (camera.height - 1)};
    check_one_is_given(table);
    if (auto intrinsics = table.table("intrinsics")) read_intrinsics(*intrinsics, p.pinhole);
    read_field_of_view(table, camera, p);
    camera.model = make_projection(p);
    read_calibration_key(table, camera, folder);
    assert(camera.model);
}

}  // namespace narpa
