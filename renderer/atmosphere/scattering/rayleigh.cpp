#include "renderer/atmosphere/scattering/rayleigh.h"

#include <cmath>
#include <numbers>

#include "renderer/atmosphere/refraction/refractive_index.h"

namespace narpa {
namespace {

constexpr double kCarbonDioxide = 360e-6;        // by volume
constexpr double kMolecules_1_m3 = 2.546899e25;  // at 288.15 K and 1013.25 hPa

/// King's factor: depolarization of dry air, gas by gas (D. Bates, Planet. Space Sci. 32, 1984).
double king_factor(double wavelength_m) {
    const double s2 = 1e-12 / (wavelength_m * wavelength_m);
    const double nitrogen = 1.034 + 3.17e-4 * s2, oxygen = 1.096 + 1.385e-3 * s2 + 1.448e-4 * s2 * s2;
    constexpr double kCarbonPercent = 100 * kCarbonDioxide;
    return (78.084 * nitrogen + 20.946 * oxygen + 0.934 * 1.00 + kCarbonPercent * 1.15) /
           (78.084 + 20.946 + 0.934 + kCarbonPercent);
}

}  // namespace

double rayleigh_cross_section_m2(double wavelength_m) noexcept {
    const double n = 1 + standard_refractivity(wavelength_m) * (1 + 0.54 * (kCarbonDioxide - 0.0003));
    const double n2 = n * n, polarizability = (n2 - 1) / (n2 + 2) / kMolecules_1_m3;
    return 24 * std::pow(std::numbers::pi, 3) * polarizability * polarizability * king_factor(wavelength_m) /
           std::pow(wavelength_m, 4);
}

double rayleigh_scattering_1_m(double wavelength_m) noexcept {
    return rayleigh_cross_section_m2(wavelength_m) * kMolecules_1_m3;
}

double rayleigh_optical_depth(double wavelength_m) noexcept {
    return rayleigh_scattering_1_m(wavelength_m) * kAirColumn_m;
}

double rayleigh_phase(double cosine, double depolarization) noexcept {
    const double g = depolarization / (2 - depolarization);
    return 3 / (16 * std::numbers::pi * (1 + 2 * g)) * ((1 + 3 * g) + (1 - g) * cosine * cosine);
}

double henyey_greenstein_phase(double cosine, double asymmetry) noexcept {
    const double g = asymmetry, s = 1 + g * g - 2 * g * cosine;
    return (1 - g * g) / (4 * std::numbers::pi * s * std::sqrt(s));
}

}  // namespace narpa
