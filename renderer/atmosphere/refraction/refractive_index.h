/// renderer/atmosphere/refraction/refractive_index.h - refractive index of air, by height and by wavelength.
#pragma once

namespace narpa {

/// Air at a height.
struct AirState {
    double temperature_k = 0, pressure_hpa = 0;
    int layer = 0;  ///< 0 troposphere, 1 lower stratosphere, 2 above
};

/// The two layers of the NaRPA paper and the third of their source, NASA Glenn's Earth atmosphere model, whose
/// constants are for feet, degrees Fahrenheit and pounds per square foot: converted here. Layers meet at 36152 ft
/// and 82345 ft. `height_m` above sea level, at least -1000.
[[nodiscard]] AirState paper_air(double height_m) noexcept;

/// (n - 1) 1e6 = 79 / T (P + 4800 e / T), the paper's; P and e (water vapour) in hPa, T in K. The term of e holds
/// at radio frequencies; for light e is 0.
[[nodiscard]] double paper_refractivity(const AirState& air, double vapour_hpa = 0) noexcept;

/// n - 1 of dry air at 288.15 K and 1013.25 hPa with 300 ppm of CO2: E. Peck, K. Reeder, J. Opt. Soc. Am. 62, 1972,
/// good to 1e-9 from 230 to 1690 nm.
[[nodiscard]] double standard_refractivity(double wavelength_m) noexcept;

/// (n - 1) 1e6 of dry air: Peck and Reeder's, in proportion to the density P / T.
[[nodiscard]] double dry_refractivity(double wavelength_m, double temperature_k, double pressure_hpa) noexcept;

}  // namespace narpa
