/// renderer/atmosphere/scattering/path_traced_air.h - reference path tracer of the atmosphere, without tables.
#pragma once

#include <cstdint>

#include "base/vec3.h"
#include "renderer/atmosphere/air.h"

namespace narpa {

struct PathTracedLight {
    double radiance = 0, error = 0;  ///< for an irradiance of 1; standard error of the mean
};

/// Radiance of the air, and of the Lambertian ground where the ray meets it, towards the ray's start: at one
/// wavelength, in three dimensions, by delta tracking (E. Woodcock 1965) and next-event estimation towards a point
/// Sun, whose transmittance comes from Chapman's function. Positions from the planet's centre, metres.
[[nodiscard]] PathTracedLight path_traced_air(const AirDescription& air, double wavelength_m, const Vec3& origin,
                                              const Vec3& direction, const Vec3& to_sun, std::uint64_t paths,
                                              std::uint64_t seed = 1);

}  // namespace narpa
