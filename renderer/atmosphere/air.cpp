#include "renderer/atmosphere/air.h"

#include <cmath>

#include "renderer/atmosphere/air_kind.h"
#include "renderer/atmosphere/fast_exp.h"
#include "renderer/atmosphere/gauss_legendre.h"
#include "renderer/atmosphere/scattering/rayleigh.h"

namespace narpa {
namespace {

double planck(double wavelength_m) {
    constexpr double kSecondRadiation_m_k = 1.438776877e-2, kSun_k = 5772;
    return 1 / (std::pow(wavelength_m * 1e6, 5) * std::expm1(kSecondRadiation_m_k / (wavelength_m * kSun_k)));
}

}  // namespace

AirCoefficients coefficients(const AirDescription& air, double wavelength_m) {
    return air.kind->coefficients(air, wavelength_m);
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
