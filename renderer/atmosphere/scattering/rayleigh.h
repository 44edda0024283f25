/// renderer/atmosphere/scattering/rayleigh.h - scattering by molecules and by particles.
#pragma once

namespace narpa {

/// Of one molecule of dry air (360 ppm CO2), m^2: B. Bodhaine et al., J. Atmos. Oceanic Technol. 16, 1999, from
/// first principles: Peck and Reeder's index, Bates' depolarization by gas. 250 to 1600 nm.
[[nodiscard]] double rayleigh_cross_section_m2(double wavelength_m) noexcept;
/// At 288.15 K and 1013.25 hPa, 1/m.
[[nodiscard]] double rayleigh_scattering_1_m(double wavelength_m) noexcept;
/// Of a vertical path through all air above sea level at 1013.25 hPa, at 45 degrees of latitude.
[[nodiscard]] double rayleigh_optical_depth(double wavelength_m) noexcept;
/// rayleigh_optical_depth / rayleigh_scattering_1_m, the same at all wavelengths: height of the air column if all
/// of it had the density at sea level.
inline constexpr double kAirColumn_m = 8449.6327724132452;

/// Phase functions of the cosine of the scattering angle, 1/sr; their integral over the sphere is 1.
[[nodiscard]] constexpr double rayleigh_phase(double cosine) noexcept {
    return 0.059683103659460751 * (1 + cosine * cosine);  // 3 / (16 pi)
}
/// With the depolarization of anisotropic molecules: S. Chandrasekhar, Radiative Transfer, 1960, equation 254. Dry
/// air: 0.0279.
[[nodiscard]] double rayleigh_phase(double cosine, double depolarization) noexcept;
/// L. Henyey, J. Greenstein, Astrophysical Journal 93, 1941.
[[nodiscard]] double henyey_greenstein_phase(double cosine, double asymmetry) noexcept;

}  // namespace narpa
