/// renderer/trace/shading.h - the surface at a hit: material, textures, shading normal.
#pragma once

#include "renderer/material/bsdf.h"
#include "renderer/trace/tracer.h"

namespace narpa {

/// What stands at the hit, seen along `ray_direction` (unit, world, towards the surface) with a beam that is `width_m` wide
/// there, measured across the ray: textures are averaged over what the beam covers. Normal and bump maps turn
/// Surface::normal, never to the far side of the ray.
[[nodiscard]] Surface surface_at(const Tracer& tracer, const Placement& at, const Hit& hit, const Vec3& ray_direction,
                                 double width_m) noexcept;

}  // namespace narpa
