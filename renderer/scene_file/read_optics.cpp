#include <fmt/format.h>

#include <algorithm>

#include "base/constants.h"
#include "renderer/assets/point_spread_file.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr TableKey kLensRows[]{
    {"aperture_diameter_m", rows::number(kPositive)},
    {"focal_length_m", rows::number(kPositive)},
    {"f_number", rows::number(kPositive)},
    {"focus_distance_m", rows::number({.low = 0, .low_open = true, .infinite = true}), "a number > 0, or inf"},
};
constexpr TableKey kPointSpreadRows[]{
    {"sigma_px", rows::number({.low = 0, .high = 8, .low_open = true})},
    {"wavelength_m", rows::number({.low = 1e-8, .high = 1e-4})},
    {"image", rows::file()},
    {"samples_per_px", rows::number({.low = 1, .high = 64})},
    {"centre", rows::pair()},
};
constexpr TableKey kVignettingRows[]{{"cos4", rows::boolean()}, {"polynomial", rows::numbers({1, 2, 3})}};
constexpr TableKey kGhostRows[]{
    {"strength", rows::number({.low = 0, .high = 1, .low_open = true}),
     "a share of the Sun's light, the product of two reflectances"},
    {"radius_px", rows::number({.low = 1, .high = 1e4}), "the radius of the disc"},
    {"scale", rows::number({.low = -10, .high = 10})},
    {"within_deg", rows::number({.low = 0, .high = 89, .low_open = true}),
     "the Sun's largest angle from the optical axis"},
};
constexpr TableKeys kLensKeys{.rows = kLensRows}, kPointSpreadKeys{.rows = kPointSpreadRows},
    kVignettingKeys{.rows = kVignettingRows}, kGhostKeys{.rows = kGhostRows};
constexpr TableKey kOpticsRows[]{
    {"lens", rows::table(kLensKeys)},
    {"psf", rows::table(kPointSpreadKeys)},
    {"vignetting", rows::table(kVignettingKeys)},
    {"veiling_glare", rows::number({.low = 0, .high = 1, .high_open = true})},
    {"ghost", rows::table(kGhostKeys)},
};

/// Thin lens, by the diameter of its aperture, or by its focal length and the camera's f-number. If only the lens
/// states the f-number, the detector takes it.
std::optional<Lens> read_lens(TableReader& camera, std::optional<Detector>& detector) {
    auto table = camera.table("lens");
    if (!table) return std::nullopt;
    Lens lens;
    table->read("aperture_diameter_m", lens.aperture_diameter_m);
    const auto focal_length = table->number("focal_length_m");
    auto f_number = table->number("f_number");
    auto of_detector = camera.table("detector");
    const bool detector_has_one = detector && of_detector->has("f_number");
    if (table->has("aperture_diameter_m")) {
        for (const char* key : {"focal_length_m", "f_number"})
            table->refuse(key, "there is an aperture_diameter_m already, expected one of the two");
    } else if (!table->has("focal_length_m") && !table->has("f_number")) {
        table->require("aperture_diameter_m", "a number > 0, or focal_length_m and f_number");
    } else {
        table->require("focal_length_m", "a number > 0, as there is an f_number");
        if (!detector_has_one) table->require("f_number", "a number > 0, here or in the detector");
    }
    if (f_number && detector_has_one && *f_number != detector->f_number)
        table->fail("f_number",
                    fmt::format("the detector's is {}, expected the same: a camera has one", detector->f_number));
    if (f_number && detector) detector->f_number = *f_number;
    if (!f_number && detector_has_one) f_number = detector->f_number;
    if (focal_length && f_number) lens.aperture_diameter_m = *focal_length / *f_number;
    lens.focus_distance_m = table->number("focus_distance_m").value_or(1);
    if (focal_length && table->has("focus_distance_m") && lens.focus_distance_m <= *focal_length)
        table->fail("focus_distance_m", fmt::format("got {}, expected more than the focal length of {} m",
                                                    lens.focus_distance_m, *focal_length));
    table->finish();
    return lens;
}

/// Reads the image of a point spread function, whose samples must be within the reach of the filter.
void read_point_spread_keys_of_image(TableReader& table, PointSpreadFunction& spread,
                                     const std::filesystem::path& folder, std::vector<std::string>& warnings) {
    const auto name = table.text("image");
    for (const char* key : {"samples_per_px", "centre"})
        if (!name) table.refuse(key, "there is no image");
    table.read("samples_per_px", spread.samples_per_px);
    const auto centre = table.pair("centre");
    if (!name) return;
    Result<std::shared_ptr<PointSpreadImage>> image = read_point_spread_image((folder / *name).string(), &warnings);
    if (!image) return table.fail("image", image.error().text());
    PointSpreadImage& i = **image;
    if (centre) i.centre_x = (*centre)[0], i.centre_y = (*centre)[1];
    const double reach = std::max({i.centre_x, i.width - 1 - i.centre_x, i.centre_y, i.height - 1 - i.centre_y}) /
                         spread.samples_per_px;
    if (reach > kPointSpreadReach_px)
        table.fail("image", fmt::format("reaches {:g} pixels from its centre, expected at most {}", reach,
                                        kPointSpreadReach_px));
    spread.image = *image;
}

std::optional<PointSpreadFunction> read_point_spread(TableReader& camera, const std::optional<Detector>& detector,
                                                     const std::filesystem::path& folder,
                                                     std::vector<std::string>& warnings) {
    auto table = camera.table("psf");
    if (!table) return std::nullopt;
    PointSpreadFunction spread;
    table->read("sigma_px", spread.sigma_px);
    const auto wavelength_m = table->number("wavelength_m");
    read_point_spread_keys_of_image(*table, spread, folder, warnings);
    if (!table->has("sigma_px") && !table->has("wavelength_m") && !table->has("image"))
        table->require("sigma_px", "a Gaussian's standard deviation, or wavelength_m, or an image");
    if (wavelength_m && !detector)
        table->fail("wavelength_m", "needs f_number and pixel_pitch_m of a detector, expected a [camera.detector]");
    if (wavelength_m && detector)
        spread.cutoff_per_px = detector->pixel_pitch_m / (*wavelength_m * detector->f_number);
    table->finish();
    return spread;
}

std::optional<Vignetting> read_vignetting(TableReader& camera) {
    auto table = camera.table("vignetting");
    if (!table) return std::nullopt;
    Vignetting v;
    table->read("cos4", v.cos4);
    const auto polynomial = table->numbers("polynomial").value_or(std::vector<double>{});
    std::ranges::copy(polynomial, v.polynomial.begin());
    if (!table->has("cos4") && !table->has("polynomial")) table->require("cos4", "true, or a polynomial");
    table->finish();
    return v;
}

std::optional<Ghost> read_ghost(TableReader& camera, bool has_sun) {
    auto table = camera.table("ghost");
    if (!table) return std::nullopt;
    Ghost ghost;
    table->read("strength", ghost.strength);
    table->read("radius_px", ghost.radius_px);
    table->read("scale", ghost.scale);
    ghost.within_rad = table->number("within_deg").value_or(0) * kPi / 180;
    if (!has_sun) table->fail("strength", "there is no Sun, expected a [sun]");
    table->finish();
    return ghost;
}

}  // namespace

constinit const TableKeys kOpticsKeys{.rows = kOpticsRows};

void read_optics(TableReader& table, Camera& camera, bool has_sun, const std::filesystem::path& folder,
                 std::vector<std::string>& warnings) {
    camera.lens = read_lens(table, camera.detector);
    camera.point_spread = read_point_spread(table, camera.detector, folder, warnings);
    camera.vignetting = read_vignetting(table);
    table.read("veiling_glare", camera.veiling_glare);
    camera.ghost = read_ghost(table, has_sun);
}

}  // namespace narpa
