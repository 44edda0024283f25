/// renderer/material/regolith.h - phase functions of the soils of airless bodies.
///
/// All functions use the phase angle a, between the directions to the light and to the viewer: a = 0 is full phase,
/// the scattering angle is pi - a.
#pragma once

#include "renderer/material/material.h"

namespace narpa {

/// Henyey and Greenstein's (1941) phase function, mean 1 over the sphere: (1 - g^2) / (1 + g^2 + 2 g cos a)^(3/2).
/// g < 0 scatters backward, |g| < 1.
[[nodiscard]] double henyey_greenstein(double g, double cos_phase) noexcept;

/// Cosine of a phase angle chosen with density `henyey_greenstein` / 2 in that cosine; u in [0, 1).
[[nodiscard]] double henyey_greenstein_cosine(double g, double u) noexcept;

/// Spherical (Bond) albedo of a Lommel-Seeliger sphere whose grains have w = 1 and asymmetry g: 2 (1 - ln 2) / 3
/// for g = 0. Relative error below 1e-3 for |g| <= 0.6.
[[nodiscard]] double lommel_seeliger_bond_albedo(double g) noexcept;

/// Weight L of the Lommel-Seeliger part, 1 at full phase: A. McEwen, "A Precise Lunar Photometric Function", Lunar
/// and Planetary Science 27, 841 (1996). The fit reaches 0 at 103.95 degrees, and stays there.
[[nodiscard]] double lunar_lambert_weight(double phase_rad) noexcept;

/// Largest directional albedo of `lunar_lambert` over its normal albedo: at grazing incidence. Normal albedos up to
/// the inverse, 0.586, keep energy.
inline constexpr double kLunarLambertLargest = 1.704;

}  // namespace narpa
