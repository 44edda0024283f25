/// renderer/material/albedo.h - total reflectance of a surface.
#pragma once

#include "renderer/material/bsdf.h"

namespace narpa {

/// Directional-hemispherical reflectance of f for light from (or towards, where f is reciprocal) a direction whose
/// cosine to the normal is `mu`: the integral of f n.l over the hemisphere, on `steps` x `steps` points. For the
/// kinds without narrow lobes.
[[nodiscard]] Rgb directional_albedo(const Surface& s, double mu, int steps) noexcept;

/// The largest directional albedo that the material reaches, its textures white: above 1 in a band, paths would
/// gain energy at each bounce. By quadrature (within 4e-3) for lommel_seeliger and hapke, infinite for
/// phong_classic, which has none, exact or a bound for the others. Costs milliseconds: for when a scene is read.
[[nodiscard]] Rgb largest_albedo(const Material& m) noexcept;

}  // namespace narpa
