/// renderer/detector/solar_bands.h - each band's share of sunlight.
#pragma once

#include <array>

namespace narpa {

/// A band of the solar spectrum, taken as a blackbody at the Sun's effective temperature, 5772 K (IAU 2015
/// resolution B3). Radiance in a band is written as if the whole spectrum had that band's reflectance, so that
/// white under 1361 W m^-2 reads the same in all three.
struct SolarBand {
    double low_m, high_m;
    double fraction;           ///< of the radiant power at all wavelengths
    double mean_wavelength_m;  ///< weighted by power, so that photons = energy * wavelength / (h c) exactly
};
inline constexpr double kSolarTemperature_k = 5772;
inline constexpr std::array<SolarBand, 3> kSolarBands{{{580e-9, 680e-9, 0.11658700493, 628.736801671e-9},
                                                       {490e-9, 580e-9, 0.11619149802, 534.643816139e-9},
                                                       {400e-9, 490e-9, 0.11252361501, 445.972322259e-9}}};

inline constexpr double kPlanck_j_s = 6.62607015e-34;     ///< exact, SI 2019
inline constexpr double kLightSpeed_m_s = 299'792'458.0;  ///< exact

}  // namespace narpa
