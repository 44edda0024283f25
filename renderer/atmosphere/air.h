/// renderer/atmosphere/air.h - what an atmosphere is made of: gas and aerosol whose densities fall exponentially
/// with height, and ozone in a layer; and how each attenuates light at some wavelengths.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "renderer/atmosphere/air_description.h"
#include "renderer/atmosphere/scattering/spherical_harmonics.h"

namespace narpa {

/// Coefficients at one wavelength and at surface density (ozone: at its maximum density), 1/m.
struct AirCoefficients {
    double gas_scattering = 0;
    double aerosol_scattering = 0, aerosol_extinction = 0;
    double ozone_absorption = 0;
    double asymmetry = 0;  ///< of the aerosol: mean cosine of its scattering, a Henyey-Greenstein function
};
[[nodiscard]] AirCoefficients coefficients(const AirDescription& air, double wavelength_m);

/// Backscatter coefficients at surface density, 1/(m sr).
struct AirBackscatter {
    double gas = 0, aerosol = 0;
};
[[nodiscard]] AirBackscatter backscatter(const AirDescription& air, const AirCoefficients& at);

/// A quadrature node: a wavelength that represents part of one of the camera's bands (solar_bands.h).
struct SpectralNode {
    double wavelength_m = 0;
    int band = 0;                 ///< 0 red, 1 green, 2 blue
    double weight = 0;            ///< share of the band's sunlight; the weights of a band add up to 1
    double from_m = 0, to_m = 0;  ///< interval that it represents
};
/// Red 580 to 680 nm, green 490 to 580, blue 400 to 490: `per_band` Gauss points of each, weighted with sunlight as
/// a blackbody of 5772 K.
[[nodiscard]] std::vector<SpectralNode> spectral_nodes(int per_band);

/// Ozone: the column above a height is a logistic function of the height, A. Lacis, J. Hansen, J. Atmos. Sci. 31,
/// 1974.
inline constexpr double kOzoneMiddle_m = 20'000, kOzoneWidth_m = 5'000;

/// Relative densities: gas and aerosol relative to the surface, ozone relative to its maximum.
struct AirDensities {
    float gas = 0, aerosol = 0, ozone = 0;
};

/// An atmosphere at some wavelengths, ready for evaluation. Arrays hold `lanes` values: the nodes, and zeros up to
/// a multiple of 8.
class Air {
public:
    static constexpr std::size_t kMaxPerBand = 8, kMaxLanes = 24;
    using Spectrum = std::array<float, kMaxLanes>;

    /// `per_band` in [1, kMaxPerBand].
    Air(const AirDescription& description, int per_band);
    /// At one wavelength, in lane 0.
    Air(const AirDescription& description, double wavelength_m);

    [[nodiscard]] const AirDescription& description() const { return description_; }
    [[nodiscard]] std::size_t lanes() const { return lanes_; }
    [[nodiscard]] double ground_radius_m() const { return description_.ground_radius_m; }
    [[nodiscard]] double top_radius_m() const { return description_.ground_radius_m + description_.top_m; }
    [[nodiscard]] AirDensities densities(double height_m) const noexcept;
    /// Density relative to the layer's maximum.
    [[nodiscard]] static float ozone_density(float height_m) noexcept;

    // Coefficients at reference density, 1/m. In multiple scattering, the aerosol's forward peak (Legendre moments
    // above kMaxDegree) counts as unscattered light (delta-M); the "scaled" coefficients exclude it.
    Spectrum gas{}, aerosol{}, aerosol_extinction{}, ozone{}, asymmetry{};
    Spectrum scaled_aerosol{}, scaled_extinction{};
    std::array<Spectrum, kMaxDegree + 1> moment{};  ///< Legendre moments of the scaled phase function
    Spectrum red{}, green{}, blue{};                ///< weights of the lanes in the bands

private:
    void fill(std::size_t lane, const AirCoefficients& c);

    AirDescription description_;
    std::vector<SpectralNode> nodes_;
    std::size_t lanes_ = 0;
};

}  // namespace narpa
