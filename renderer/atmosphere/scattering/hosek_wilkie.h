/// renderer/atmosphere/scattering/hosek_wilkie.h - the clear-sky model that L. Hosek and A. Wilkie fitted to
/// path-traced skies: "An Analytic Model for Full Spectral Sky-Dome Radiance", ACM Transactions on Graphics 31(4),
/// 2012. For observers on the ground and a Sun above the horizon.
#pragma once

#include <array>

#include "base/vec3.h"

namespace narpa {

class HosekWilkieSky {
public:
    /// `turbidity` in [1, 10], `ground_albedo` in [0, 1], `sun_elevation_rad` in [0, pi / 2].
    HosekWilkieSky(double turbidity, double ground_albedo, double sun_elevation_rad);

    /// CIE 1931 tristimulus values of the radiance, W m^-2 sr^-1 (times 683 lm / W: Y is luminance). Below the
    /// horizon: as at it. `zenith_rad` from the zenith, `to_sun_rad` from the Sun.
    [[nodiscard]] std::array<double, 3> xyz(double zenith_rad, double to_sun_rad) const noexcept;

    /// Radiance in the camera's bands for a Sun of irradiance 1 in each band above the air: linear sRGB divided by
    /// that of extraterrestrial sunlight (ASTM G-173 spectrum), because the bands (red 580 to 680 nm, ...) are
    /// close to those of sRGB.
    [[nodiscard]] Rgb radiance(double zenith_cosine, double sun_cosine) const noexcept;

private:
    std::array<std::array<double, 9>, 3> shape_{};
    std::array<double, 3> scale_{};
};

}  // namespace narpa
