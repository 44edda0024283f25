#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/atmosphere/air_kind.h"
#include "renderer/atmosphere/scattering/rayleigh.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

double interpolated(std::span<const double> values, double position) {
    const double x = std::clamp(position, 0.0, static_cast<double>(values.size() - 1));
    const auto i = std::min(static_cast<std::size_t>(x), values.size() - 2);
    const double f = x - static_cast<double>(i);
    return (1 - f) * values[i] + f * values[i + 1];
}

constexpr double kReference_m = 550e-9;

constexpr double kDobson_1_m2 = 2.687e20;
/// Cross-sections, m^2, of 10 nm each from 360 nm on, at 233 K: the IUP Bremen spectra of 2011 (A. Serdyuchenko et
/// al., Atmos. Meas. Tech. 7, 2014) as averaged by E. Bruneton, "A Qualitative and Quantitative Evaluation of 8
/// Clear Sky Models", IEEE TVCG 23, 2017.
constexpr double kOzoneFirst_m = 365e-9, kOzoneStep_m = 10e-9;
constexpr std::array kOzone_m2{
    1.18e-27,  2.182e-28, 2.818e-28, 6.636e-28, 1.527e-27, 2.763e-27, 5.52e-27,  8.451e-27, 1.582e-26, 2.316e-26,
    3.669e-26, 4.924e-26, 7.752e-26, 9.016e-26, 1.48e-25,  1.602e-25, 2.139e-25, 2.755e-25, 3.091e-25, 3.5e-25,
    4.266e-25, 4.672e-25, 4.398e-25, 4.701e-25, 5.019e-25, 4.305e-25, 3.74e-25,  3.215e-25, 2.662e-25, 2.238e-25,
    1.852e-25, 1.473e-25, 1.209e-25, 9.423e-26, 7.455e-26, 6.566e-26, 5.105e-26, 4.15e-26,  4.228e-26, 3.237e-26,
    2.451e-26, 2.801e-26, 2.534e-26, 1.624e-26, 1.465e-26, 2.078e-26, 1.383e-26, 7.105e-27};

// Earth's aerosol: extinction proportional to wavelength^-1.3 (A. Angstrom 1929; exponent of A. Preetham et al.,
// SIGGRAPH 1999), asymmetry 0.76, single-scattering albedo 0.9.
constexpr double kAngstrom = 1.3, kEarthAsymmetry = 0.76, kEarthAlbedo = 0.9;

constexpr std::string_view kOfEarth = "belongs to planet = \"earth\"; the dust of Mars has a \"dust_depth\"";
constexpr TableKey kEarthRows[]{
    {"turbidity", rows::number({.low = 1, .high = 10}), {}, kOfEarth},
    {"ozone_du", rows::number({.low = 0, .high = 1000}), {}, kOfEarth},
};

double ozone_maximum_1_m() {  // density at the maximum of a column of 1
    return (1 + std::exp(-kOzoneMiddle_m / kOzoneWidth_m)) / (4 * kOzoneWidth_m);
}

AirCoefficients earth_coefficients(const AirDescription& air, double wavelength_m) {
    AirCoefficients c;
    c.gas_scattering = air.gas_amount * rayleigh_scattering_1_m(wavelength_m);
    const double depth = (air.turbidity - 1) * rayleigh_optical_depth(kReference_m);
    c.aerosol_extinction = depth / air.aerosol_height_m * std::pow(kReference_m / wavelength_m, kAngstrom);
    c.aerosol_scattering = kEarthAlbedo * c.aerosol_extinction;
    c.asymmetry = kEarthAsymmetry;
    const double cross_section = interpolated(kOzone_m2, (wavelength_m - kOzoneFirst_m) / kOzoneStep_m);
    c.ozone_absorption = air.ozone_du * kDobson_1_m2 * cross_section * ozone_maximum_1_m();
    return c;
}

void read_earth_air(TableReader& table, AirDescription& air) {
    table.read("turbidity", air.turbidity);
    table.read("ozone_du", air.ozone_du);
}

// Mars: scattering coefficient of carbon dioxide at 610 Pa and 210 K relative to that of Earth's air at the
// surface: density, squared ratio of refractivities (449e-6 / 277e-6), King's factor 1.15 to 1.05.
constexpr double kMarsGas = 610 / (1.380649e-23 * 210) / 2.546899e25 * (449.0 / 277 * 449 / 277) * (1.15 / 1.05);
// Dust: grey extinction, blue absorbed most, red scattered most widely: rounded from the range of retrievals from
// Pathfinder's and Viking's images (M. Ockert-Bell et al., JGR 102, 1997; M. Tomasko et al., JGR 104, 1999).
constexpr double kDustFirst_m = 400e-9, kDustStep_m = 50e-9;
constexpr std::array kDustAlbedo{0.70, 0.77, 0.81, 0.87, 0.925, 0.95, 0.96};
constexpr std::array kDustAsymmetry{0.82, 0.80, 0.77, 0.73, 0.70, 0.68, 0.67};

constexpr TableKey kMarsRows[]{{"dust_depth",
                                rows::number({.low = 0, .high = 10}),
                                {},
                                "belongs to planet = \"mars\"; the Earth's aerosol has a \"turbidity\""}};

AirCoefficients mars_coefficients(const AirDescription& air, double wavelength_m) {
    AirCoefficients c;
    const double gas = air.gas_amount * rayleigh_scattering_1_m(wavelength_m);
    c.gas_scattering = kMarsGas * gas;
    const double at = (wavelength_m - kDustFirst_m) / kDustStep_m;
    c.aerosol_extinction = air.aerosol_depth / air.aerosol_height_m;
    c.aerosol_scattering = interpolated(kDustAlbedo, at) * c.aerosol_extinction;
    c.asymmetry = interpolated(kDustAsymmetry, at);
    return c;
}

void read_mars_air(TableReader& table, AirDescription& air) {
    table.read("dust_depth", air.aerosol_depth);
}

constexpr AirKind kMarsAir{"mars", kMarsRows, [] { return mars_air(); }, read_mars_air, mars_coefficients};

}  // namespace

constinit const AirKind kEarthAir{"earth", kEarthRows, [] { return earth_air(); }, read_earth_air,
                                  earth_coefficients};

std::span<const AirKind* const> air_kinds() {
    static constexpr std::array all{&kEarthAir, &kMarsAir};
    return all;
}

AirDescription earth_air(double turbidity) {
    AirDescription air;
    air.turbidity = turbidity;
    return air;
}

AirDescription mars_air(double dust_depth) {
    AirDescription air;
    air.kind = &kMarsAir;
    air.ground_radius_m = 3'389'500;
    air.top_m = 100'000;
    air.gas_height_m = 11'100;
    air.aerosol_height_m = 11'100;
    air.aerosol_depth = dust_depth;
    air.ozone_du = 0;
    air.ground_albedo = 0.2;
    return air;
}

}  // namespace narpa
