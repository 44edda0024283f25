#include "renderer/atmosphere/refraction/refractive_index.h"

#include <cmath>

namespace narpa {
namespace {

constexpr double kFoot_m = 0.3048, kHpaPerPsf = 0.45359237 * 9.80665 / (kFoot_m * kFoot_m) / 100;
constexpr double kTroposphereTop_ft = 36152, kStratosphere_ft = 82345;
constexpr double kRankine_f = 459.7;        // in the model's pressures
constexpr double kAbsoluteZero_f = 459.67;  // exact

double square(double x) {
    return x * x;
}

}  // namespace

AirState paper_air(double height_m) noexcept {
    const double h = height_m / kFoot_m;
    double t_f = 0, p_psf = 0;
    int layer = 0;
    if (h < kTroposphereTop_ft) {
        t_f = 59 - 0.00356 * h;
        p_psf = 2116 * std::pow((t_f + kRankine_f) / 518.6, 5.256);
    } else if (h < kStratosphere_ft) {
        layer = 1;
        t_f = -70;
        p_psf = 473.1 * std::exp(1.73 - 0.000048 * h);
    } else {
        layer = 2;
        t_f = -205.05 + 0.00164 * h;
        p_psf = 51.97 * std::pow((t_f + kRankine_f) / 389.98, -11.388);
    }
    return {(t_f + kAbsoluteZero_f) * 5 / 9, p_psf * kHpaPerPsf, layer};
}

double paper_refractivity(const AirState& air, double vapour_hpa) noexcept {
    return 79 / air.temperature_k * (air.pressure_hpa + 4800 * vapour_hpa / air.temperature_k);
}

double standard_refractivity(double wavelength_m) noexcept {
    const double s2 = square(1e-6 / wavelength_m);
    return 1e-8 * (8060.51 + 2480990 / (132.274 - s2) + 17455.7 / (39.32957 - s2));
}

double dry_refractivity(double wavelength_m, double temperature_k, double pressure_hpa) noexcept {
    return 1e6 * standard_refractivity(wavelength_m) * (pressure_hpa / 1013.25) * (288.15 / temperature_k);
}

}  // namespace narpa
