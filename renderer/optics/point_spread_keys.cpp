#include <fmt/format.h>

#include <algorithm>

#include "renderer/keys/toml_reader.h"
#include "renderer/optics/point_spread.h"

namespace narpa {
namespace {

constexpr TableKey kPointSpreadRows[]{
    {"sigma_px", rows::number({.low = 0, .high = 8, .low_open = true})},
    {"wavelength_m", rows::number({.low = 1e-8, .high = 1e-4})},
    {"image", rows::file()},
    {"samples_per_px", rows::number({.low = 1, .high = 64})},
    {"centre", rows::pair()},
};
constexpr TableKeys kPointSpreadKeys{.rows = kPointSpreadRows};
constexpr TableKey kPointSpreadOfCamera[]{{"psf", rows::table(kPointSpreadKeys)}};

/// Reads the image of a point spread function, whose samples must be within the reach of the filter.
void read_keys_of_image(TableReader& table, PointSpreadFunction& spread, const OpticsContext& context) {
    const auto name = table.text("image");
    for (const char* key : {"samples_per_px", "centre"})
        if (!name) table.refuse(key, "there is no image");
    table.read("samples_per_px", spread.samples_per_px);
    const auto centre = table.pair("centre");
    if (!name) return;
    const std::shared_ptr<PointSpreadImage> image = context.read_image(table, "image");
    if (!image) return;
    PointSpreadImage& i = *image;
    if (centre) i.centre_x = (*centre)[0], i.centre_y = (*centre)[1];
    const double reach = std::max({i.centre_x, i.width - 1 - i.centre_x, i.centre_y, i.height - 1 - i.centre_y}) /
                         spread.samples_per_px;
    if (reach > kPointSpreadReach_px)
        table.fail("image", fmt::format("reaches {:g} pixels from its centre, expected at most {}", reach,
                                        kPointSpreadReach_px));
    spread.image = image;
}

void read_point_spread(TableReader& camera, const OpticsContext& context, Optics& optics) {
    auto table = camera.table("psf");
    if (!table) return;
    const Detector* const detector = context.detector;
    PointSpreadFunction spread;
    table->read("sigma_px", spread.sigma_px);
    const auto wavelength_m = table->number("wavelength_m");
    read_keys_of_image(*table, spread, context);
    if (!table->has("sigma_px") && !table->has("wavelength_m") && !table->has("image"))
        table->require("sigma_px", "a Gaussian's standard deviation, or wavelength_m, or an image");
    if (wavelength_m && !detector)
        table->fail("wavelength_m", "needs f_number and pixel_pitch_m of a detector, expected a [camera.detector]");
    if (wavelength_m && detector)
        spread.cutoff_per_px = detector->pixel_pitch_m / (*wavelength_m * detector->f_number);
    table->finish();
    optics.point_spread = spread;
}

}  // namespace

constinit const OpticsKind kPointSpread{kPointSpreadOfCamera, read_point_spread};

}  // namespace narpa
