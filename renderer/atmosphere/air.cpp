#include "renderer/atmosphere/air.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "renderer/atmosphere/fast_exp.h"
#include "renderer/atmosphere/gauss_legendre.h"
#include "renderer/atmosphere/rayleigh.h"

namespace narpa {
namespace {

constexpr double kReference_m = 550e-9;

// Ozone: the column above a height is a logistic function of the height, A. Lacis, J. Hansen, J. Atmos. Sci. 31,
// 1974.
constexpr double kOzoneMiddle_m = 20'000, kOzoneWidth_m = 5'000;
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

// Mars: scattering coefficient of carbon dioxide at 610 Pa and 210 K relative to that of Earth's air at the
// surface: density, squared ratio of refractivities (449e-6 / 277e-6), King's factor 1.15 to 1.05.
constexpr double kMarsGas = 610 / (1.380649e-23 * 210) / 2.546899e25 * (449.0 / 277 * 449 / 277) * (1.15 / 1.05);
// Dust: grey extinction, blue absorbed most, red scattered most widely: rounded from the range of retrievals from
// Pathfinder's and Viking's images (M. Ockert-Bell et al., JGR 102, 1997; M. Tomasko et al., JGR 104, 1999).
constexpr double kDustFirst_m = 400e-9, kDustStep_m = 50e-9;
constexpr std::array kDustAlbedo{0.70, 0.77, 0.81, 0.87, 0.925, 0.95, 0.96};
constexpr std::array kDustAsymmetry{0.82, 0.80, 0.77, 0.73, 0.70, 0.68, 0.67};

double interpolated(std::span<const double> values, double position) {
    const double x = std::clamp(position, 0.0, static_cast<double>(values.size() - 1));
    const auto i = std::min(static_cast<std::size_t>(x), values.size() - 2);
    const double f = x - static_cast<double>(i);
    return (1 - f) * values[i] + f * values[i + 1];
}

double ozone_maximum_1_m() {  // density at the maximum of a column of 1
    return (1 + std::exp(-kOzoneMiddle_m / kOzoneWidth_m)) / (4 * kOzoneWidth_m);
}

double planck(double wavelength_m) {
    constexpr double kSecondRadiation_m_k = 1.438776877e-2, kSun_k = 5772;
    return 1 / (std::pow(wavelength_m * 1e6, 5) * std::expm1(kSecondRadiation_m_k / (wavelength_m * kSun_k)));
}

}  // namespace

AirDescription earth_air(double turbidity) {
    AirDescription air;
    air.turbidity = turbidity;
    return air;
}

AirDescription mars_air(double dust_depth) {
    AirDescription air;
    air.planet = AirDescription::Planet::mars;
    air.ground_radius_m = 3'389'500;
    air.top_m = 100'000;
    air.gas_height_m = 11'100;
    air.aerosol_height_m = 11'100;
    air.aerosol_depth = dust_depth;
    air.ozone_du = 0;
    air.ground_albedo = 0.2;
    return air;
}

AirCoefficients coefficients(const AirDescription& air, double wavelength_m) {
    AirCoefficients c;
    const double gas = air.gas_amount * rayleigh_scattering_1_m(wavelength_m);
    if (air.planet == AirDescription::Planet::earth) {
        c.gas_scattering = gas;
        const double depth = (air.turbidity - 1) * rayleigh_optical_depth(kReference_m);
        c.aerosol_extinction = depth / air.aerosol_height_m * std::pow(kReference_m / wavelength_m, kAngstrom);
        c.aerosol_scattering = kEarthAlbedo * c.aerosol_extinction;
        c.asymmetry = kEarthAsymmetry;
        const double cross_section = interpolated(kOzone_m2, (wavelength_m - kOzoneFirst_m) / kOzoneStep_m);
        c.ozone_absorption = air.ozone_du * kDobson_1_m2 * cross_section * ozone_maximum_1_m();
    } else {
        c.gas_scattering = kMarsGas * gas;
        const double at = (wavelength_m - kDustFirst_m) / kDustStep_m;
        c.aerosol_extinction = air.aerosol_depth / air.aerosol_height_m;
        c.aerosol_scattering = interpolated(kDustAlbedo, at) * c.aerosol_extinction;
        c.asymmetry = interpolated(kDustAsymmetry, at);
    }
    return c;
}

AirBackscatter backscatter(const AirDescription& air, const AirCoefficients& at) {
    const double ratio = air.aerosol_lidar_ratio_sr;
    return {at.gas_scattering * rayleigh_phase(-1),
            ratio > 0 ? at.aerosol_extinction / ratio
                      : at.aerosol_scattering * henyey_greenstein_phase(-1, at.asymmetry)};
}

namespace {

/// Mean over the node's wavelength interval, because ozone's absorption has more structure than the nodes resolve.
double mean_ozone_absorption(const AirDescription& air, const SpectralNode& node) {
    constexpr int kSteps = 16;
    double sum = 0, weights = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double wavelength_m = node.from_m + (node.to_m - node.from_m) * (i + 0.5) / kSteps;
        const double weight = planck(wavelength_m);
        sum += weight * coefficients(air, wavelength_m).ozone_absorption;
        weights += weight;
    }
    return sum / weights;
}

}  // namespace

std::vector<SpectralNode> spectral_nodes(int per_band) {
    constexpr std::array<std::array<double, 2>, 3> kBands_m{{{580e-9, 680e-9}, {490e-9, 580e-9}, {400e-9, 490e-9}}};
    const Quadrature rule = gauss_legendre(static_cast<std::size_t>(per_band));
    std::vector<SpectralNode> nodes;
    for (int band = 0; band < 3; ++band) {
        const auto [low, high] = kBands_m[static_cast<std::size_t>(band)];
        double sum = 0;
        const std::size_t first = nodes.size();
        for (std::size_t i = 0; i < rule.node.size(); ++i) {
            const double wavelength_m = low + (high - low) * rule.node[i];
            const double from_m = i == 0 ? low : nodes.back().to_m, to_m = from_m + (high - low) * rule.weight[i];
            nodes.push_back({wavelength_m, band, rule.weight[i] * planck(wavelength_m), from_m, to_m});
            sum += nodes.back().weight;
        }
        for (std::size_t i = first; i < nodes.size(); ++i) nodes[i].weight /= sum;
    }
    return nodes;
}

Air::Air(const AirDescription& description, int per_band)
    : description_(description), nodes_(spectral_nodes(per_band)), lanes_((nodes_.size() + 7) / 8 * 8) {
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        AirCoefficients c = coefficients(description, nodes_[i].wavelength_m);
        c.ozone_absorption = mean_ozone_absorption(description, nodes_[i]);
        fill(i, c);
        Spectrum& weights = nodes_[i].band == 0 ? red : nodes_[i].band == 1 ? green : blue;
        weights[i] = static_cast<float>(nodes_[i].weight);
    }
}

Air::Air(const AirDescription& description, double wavelength_m)
    : description_(description), nodes_{{wavelength_m, 0, 1}}, lanes_(8) {
    fill(0, coefficients(description, wavelength_m));
    red[0] = green[0] = blue[0] = 1;
}

void Air::fill(std::size_t lane, const AirCoefficients& c) {
    const double g = c.asymmetry, f = std::pow(g, kMaxDegree + 1);
    gas[lane] = static_cast<float>(c.gas_scattering);
    aerosol[lane] = static_cast<float>(c.aerosol_scattering);
    aerosol_extinction[lane] = static_cast<float>(c.aerosol_extinction);
    ozone[lane] = static_cast<float>(c.ozone_absorption);
    asymmetry[lane] = static_cast<float>(g);
    scaled_aerosol[lane] = static_cast<float>((1 - f) * c.aerosol_scattering);
    scaled_extinction[lane] = static_cast<float>(c.aerosol_extinction - f * c.aerosol_scattering);
    for (std::size_t l = 0; l <= kMaxDegree; ++l)
        moment[l][lane] = static_cast<float>((std::pow(g, l) - f) / (1 - f));
}

AirDensities Air::densities(double height_m) const noexcept {
    const auto h = static_cast<float>(height_m);
    const AirDescription& d = description_;
    return {std::exp(-h / static_cast<float>(d.gas_height_m)),
            std::exp(-h / static_cast<float>(d.aerosol_height_m)), d.ozone_du > 0 ? ozone_density(h) : 0};
}

float Air::ozone_density(float height_m) noexcept {
    const float e = exp_of_negative(-std::abs(height_m - static_cast<float>(kOzoneMiddle_m)) *
                                    static_cast<float>(1 / kOzoneWidth_m));
    return 4 * e / ((1 + e) * (1 + e));
}

}  // namespace narpa
