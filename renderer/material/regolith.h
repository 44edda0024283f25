/// renderer/material/regolith.h - soils of airless bodies: their phase functions, and published parameters.
///
/// Everything is written in the phase angle a, between the directions to the light and to the viewer: a = 0 is full
/// phase, the scattering angle is pi - a.
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

/// A body's published parameters for Material::hapke, with the single scattering albedo w for Material::diffuse.
struct PublishedHapke {
    const char* body;
    float single_scattering_albedo;
    Hapke parameters;
    double geometric_albedo;  ///< as published beside them
    const char* source;
};

/// One-term Henyey-Greenstein fits of asymmetry g are phase_b = -g, phase_c = 1 here.
inline constexpr PublishedHapke kPublishedHapke[] = {
    {"433 Eros, 550 nm",
     0.33f,
     {0.25f, 1, 1.4f, 0.010f, 0.4887f},
     0.23,
     "J.-Y. Li, M. A'Hearn, L. McFadden, Icarus 172, 415 (2004): w 0.33, g -0.25, B0 1.4, h 0.010, theta-bar 28 "
     "deg"},
    {"9P/Tempel 1, 550 nm",
     0.039f,
     {0.49f, 1, 1.0f, 0.01f, 0.2793f},
     0.056,
     "J.-Y. Li et al., Icarus 187, 41 (2007): w 0.039, g -0.49, B0 1.0, h 0.01, theta-bar 16 deg"},
};

}  // namespace narpa
