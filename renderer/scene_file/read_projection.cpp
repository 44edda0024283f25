#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "renderer/assets/calibration_file.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr std::array kKeys{"intrinsics", "fov_diagonal_deg", "fov_horizontal_deg", "calibration"};

void read_intrinsics(TableReader& table, Camera& camera) {
    for (const char* key : {"fx", "fy"}) table.require(key, "a focal length in pixels");
    camera.fx = table.number("fx", kPositive).value_or(1);
    camera.fy = table.number("fy", kPositive).value_or(1);
    camera.cx = table.number("cx").value_or(camera.cx);
    camera.cy = table.number("cy").value_or(camera.cy);
    table.finish();
}

std::optional<Distortion> read_distortion(TableReader& camera) {
    using enum Distortion::Model;
    static constexpr std::array<std::pair<std::string_view, Distortion::Model>, 2> kModels{
        {{"opencv", opencv}, {"fisheye", fisheye}}};
    auto table = camera.table("distortion");
    if (!table) return std::nullopt;
    Distortion d;
    table->require("model", "\"opencv\" or \"fisheye\"");
    table->require("coefficients", "an array of numbers in OpenCV's order");
    d.model = table->choice<Distortion::Model>("model", kModels).value_or(opencv);
    if (d.model == fisheye)
        d.coefficients = table->numbers("coefficients", {4}).value_or(std::vector<double>(4));
    else
        d.coefficients = table->numbers("coefficients", {4, 5, 8, 12}).value_or(std::vector<double>(4));
    table->finish();
    return d;
}

/// The focal length with which the image spans `angle` from edge to edge along the unit image direction (x, y),
/// over `extent_px`. 0 where the lens does not see so wide.
double focal_length(const Camera& camera, double angle, double x, double y, double extent_px) {
    const auto model = camera.distortion ? distorted({1, 1, 0, 0}, *camera.distortion)
                                         : std::make_shared<const Pinhole>(1, 1, 0, 0);
    const Vec3 to_side = std::sin(0.5 * angle) * Vec3{x, y, 0}, forward{0, 0, std::cos(0.5 * angle)};
    const auto one = model->project(forward + to_side), other = model->project(forward - to_side);
    if (!one || !other) return 0;
    const double extent = std::hypot(one->x - other->x, one->y - other->y);
    return extent > 0 ? extent_px / extent : 0;
}

void read_field_of_view(TableReader& table, Camera& camera) {
    const bool fisheye = camera.distortion && camera.distortion->model == Distortion::Model::fisheye;
    const Range angle{.low = 0, .high = fisheye ? 360.0 : 180.0, .low_open = true, .high_open = true};
    const double diagonal_px = std::hypot(camera.width, camera.height);
    const auto take = [&](const char* key, double x, double y, double extent_px) {
        const auto deg = table.number(key, angle);
        if (!deg) return;
        const double f = focal_length(camera, *deg * kPi / 180, x, y, extent_px);
        if (f == 0)
            return table.fail(key, fmt::format("the lens does not see {} degrees: beyond some angle the distortion "
                                               "would fold the image; expected less",
                                               *deg));
        camera.fx = camera.fy = f;
    };
    take("fov_diagonal_deg", camera.width / diagonal_px, camera.height / diagonal_px, diagonal_px);
    take("fov_horizontal_deg", 1, 0, camera.width);
}

/// Size, intrinsics and distortion from a file.
void read_calibration_key(TableReader& table, Camera& camera, const std::filesystem::path& folder) {
    const auto name = table.text("calibration");
    if (!name) return;
    table.refuse("distortion", "the calibration has one, expected one of the two");
    const Result<Calibration> c = read_calibration((folder / *name).string());
    if (!c) return table.fail("calibration", c.error().text());
    if (table.has("resolution") && (camera.width != c->width || camera.height != c->height))
        table.fail("resolution",
                   fmt::format("got {} x {}, expected that of the calibration, {} x {}, or no such key",
                               camera.width, camera.height, c->width, c->height));
    camera.width = c->width, camera.height = c->height;
    camera.fx = c->pinhole.fx, camera.fy = c->pinhole.fy, camera.cx = c->pinhole.cx, camera.cy = c->pinhole.cy;
    camera.distortion = c->distortion;
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
    camera.cx = 0.5 * (camera.width - 1), camera.cy = 0.5 * (camera.height - 1);
    camera.distortion = read_distortion(table);
    check_one_is_given(table);
    if (auto intrinsics = table.table("intrinsics")) read_intrinsics(*intrinsics, camera);
    read_field_of_view(table, camera);
    read_calibration_key(table, camera, folder);
    if (camera.distortion)
        camera.model = distorted({camera.fx, camera.fy, camera.cx, camera.cy}, *camera.distortion);
}

}  // namespace narpa
