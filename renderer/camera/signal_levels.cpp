#include "renderer/camera/signal_levels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "base/pixel_format.h"
#include "renderer/detector/detector.h"

namespace narpa {
namespace {

/// Signal at full scale.
double full_electrons(const Detector& d) {
    return std::min(d.full_well_e, gain_e_per_dn(d) * (std::exp2(d.bits) - 1 - d.black_level_dn));
}

/// Signal of radiance 1 W m^-2 sr^-1 in each band, as a fraction of full scale.
std::array<double, 3> scale_of(const Camera& camera) {
    std::array<double, 3> scale;
    if (camera.detector) {
        const Detector& d = *camera.detector;
        for (int band = 0; band < 3; ++band)
            scale[static_cast<std::size_t>(band)] = electrons_per_radiance(d, band) / full_electrons(d);
    } else {
        scale.fill((is_mono(camera.format) ? 1.0 / 3 : 1.0) / camera.white_radiance);
    }
    return scale;
}

std::vector<double> signals(const Camera& camera, const RadianceImage& radiance) {
    const auto [red, green, blue] = scale_of(camera);
    std::vector<double> out(radiance.pixels.size());
    for (std::size_t i = 0; i < out.size(); ++i) {
        const Rgb& p = radiance.pixels[i];
        const std::array<double, 3> bands{red * p.x, green * p.y, blue * p.z};
        if (is_mono(camera.format)) {
            out[i] = bands[0] + bands[1] + bands[2];
        } else if (is_bayer(camera.format)) {
            const int x = static_cast<int>(i) % radiance.width, y = static_cast<int>(i) / radiance.width;
            out[i] = bands[bayer_band(camera.format, x, y)];
        } else {
            out[i] = *std::ranges::max_element(bands);
        }
        if (!(out[i] > 0)) out[i] = 0;
    }
    return out;
}

/// The smallest signal that changes the bytes of the format: 8-bit formats keep the top 8 bits of the converter's.
double darkest_step(const Camera& camera) {
    const int bits = camera.detector ? camera.detector->bits : is_16_bit(camera.format) ? 16 : 8;
    const double step_dn = is_16_bit(camera.format) ? 1 : std::exp2(bits - 8);
    const double black_dn = camera.detector ? camera.detector->black_level_dn : 0;
    double full_dn = std::exp2(bits) - 1 - black_dn;
    if (camera.detector) full_dn = full_electrons(*camera.detector) / gain_e_per_dn(*camera.detector);
    return (step_dn - std::fmod(black_dn, step_dn) - 0.5) / full_dn;
}

}  // namespace

SignalLevels signal_levels(const Camera& camera, const RadianceImage& radiance) {
    constexpr double kBright = 0.99;
    SignalLevels levels;
    levels.darkest_step = darkest_step(camera);
    std::vector<double> all = signals(camera, radiance);
    if (all.empty()) return levels;
    const auto pixels = static_cast<double>(all.size());
    if (camera.detector) levels.dark = dark_electrons(*camera.detector) / full_electrons(*camera.detector);
    levels.brightest = *std::ranges::max_element(all);
    levels.saturated_share =
        static_cast<double>(std::ranges::count_if(all, [&](double s) { return s + levels.dark >= 1; })) / pixels;
    if (levels.brightest <= 0) return levels;
    const double lit = SignalLevels::kLit * std::min(1.0, levels.brightest);
    std::erase_if(all, [&](double s) { return s <= lit; });
    levels.lit_share = static_cast<double>(all.size()) / pixels;
    const auto at = static_cast<std::ptrdiff_t>(kBright * static_cast<double>(all.size() - 1));
    std::ranges::nth_element(all, all.begin() + at);
    levels.bright = all[static_cast<std::size_t>(at)];
    return levels;
}

}  // namespace narpa
