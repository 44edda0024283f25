/// renderer/atmosphere/chapman.h - columns of air along slanted rays, in an exponential atmosphere on a sphere.
#pragma once

namespace narpa {

/// exp(y^2) erfc(y), without overflow for any y >= -25. Relative error below 1e-12.
[[nodiscard]] double erfcx(double y) noexcept;

/// Chapman's grazing-incidence function: the column along a ray to infinity, in units of the vertical column above
/// its start. `x`: radius there over the scale height, at least 20. `zenith_rad` in [0, pi]; beyond the horizontal
/// the ray passes its lowest point first, and the column grows as exp of the depth (infinite where it overflows).
/// Relative error below 1e-6 (S. Chapman, Proc. Phys. Soc. 43, 1931).
[[nodiscard]] double chapman(double x, double zenith_rad) noexcept;

}  // namespace narpa
