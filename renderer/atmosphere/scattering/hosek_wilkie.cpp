#include "renderer/atmosphere/scattering/hosek_wilkie.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "renderer/atmosphere/scattering/hosek_wilkie_table.h"

namespace narpa {
namespace {

constexpr std::size_t kControlPoints = 6, kTurbidities = 10;

/// Linear sRGB of sunlight outside the atmosphere, W m^-2: E. Bruneton's averages of ASTM G-173 over 10 nm, with
/// the colour matching functions of C. Wyman et al., JCGT 2(2), 2013. Times 683 lm / W: 133.3 klx.
constexpr std::array kSunRgb{213.411, 190.885, 183.254};

std::array<double, kControlPoints> bernstein(double x) {
    const double y = 1 - x;
    return {y * y * y * y * y,      5 * y * y * y * y * x, 10 * y * y * y * x * x,
            10 * y * y * x * x * x, 5 * y * x * x * x * x, x * x * x * x * x};
}

/// Quintic in the cube root of the elevation, linear in turbidity and albedo. `stride`: coefficients per control
/// point.
double blended(const double* table, std::size_t stride, std::size_t coefficient, double turbidity, double albedo,
               const std::array<double, kControlPoints>& weights) {
    const auto low = std::min(static_cast<std::size_t>(turbidity), kTurbidities);
    const double rest = turbidity - static_cast<double>(low);
    double sum = 0;
    for (std::size_t a = 0; a < 2; ++a)
        for (std::size_t step = 0; step < 2; ++step) {
            if (low + step > kTurbidities) continue;
            const double share = (a == 0 ? 1 - albedo : albedo) * (step == 0 ? 1 - rest : rest);
            const double* const at = table + stride * kControlPoints * (a * kTurbidities + low - 1 + step);
            for (std::size_t k = 0; k < kControlPoints; ++k)
                sum += share * weights[k] * at[stride * k + coefficient];
        }
    return sum;
}

}  // namespace

HosekWilkieSky::HosekWilkieSky(double turbidity, double ground_albedo, double sun_elevation_rad) {
    const auto weights = bernstein(std::cbrt(std::clamp(sun_elevation_rad / (0.5 * std::numbers::pi), 0.0, 1.0)));
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t i = 0; i < 9; ++i)
            shape_[c][i] = blended(kHosekWilkieShape[c], 9, i, turbidity, ground_albedo, weights);
        scale_[c] = blended(kHosekWilkieRadiance[c], 1, 0, turbidity, ground_albedo, weights);
    }
}

std::array<double, 3> HosekWilkieSky::xyz(double zenith_rad, double to_sun_rad) const noexcept {
    const double up = std::max(0.0, std::cos(zenith_rad)), nu = std::cos(to_sun_rad);
    std::array<double, 3> out{};
    for (std::size_t c = 0; c < 3; ++c) {
        const auto& s = shape_[c];
        const double aureole = (1 + nu * nu) / std::pow(1 + s[8] * s[8] - 2 * s[8] * nu, 1.5);
        out[c] =
            scale_[c] * (1 + s[0] * std::exp(s[1] / (up + 0.01))) *
            (s[2] + s[3] * std::exp(s[4] * to_sun_rad) + s[5] * nu * nu + s[6] * aureole + s[7] * std::sqrt(up));
    }
    return out;
}

Rgb HosekWilkieSky::radiance(double zenith_cosine, double sun_cosine) const noexcept {
    const auto [x, y, z] =
        xyz(std::acos(std::clamp(zenith_cosine, 0.0, 1.0)), std::acos(std::clamp(sun_cosine, -1.0, 1.0)));
    const double r = 3.2404542 * x - 1.5371385 * y - 0.4985314 * z;
    const double g = -0.9692660 * x + 1.8760108 * y + 0.0415560 * z;
    const double b = 0.0556434 * x - 0.2040259 * y + 1.0572252 * z;
    return {static_cast<float>(std::max(0.0, r / kSunRgb[0])), static_cast<float>(std::max(0.0, g / kSunRgb[1])),
            static_cast<float>(std::max(0.0, b / kSunRgb[2]))};
}

}  // namespace narpa
