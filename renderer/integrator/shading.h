/// renderer/integrator/shading.h - the surface at a hit: material, textures, shading normal.
#pragma once

#include "renderer/geometry/tracer.h"
#include "renderer/material/bsdf.h"

namespace narpa {

/// Multiplies the material's colours by the vertex colours and their textures at the hit, covers them with its
/// clouds and turns the normal by its normal and height maps.
void apply_textures(const Tracer& tracer, const BodyPoses& at, const Hit& hit, const Vec3& ray_direction,
                    double width_m, Surface& surface) noexcept;

/// The surface at the hit, seen along `ray_direction` (unit, world, towards the surface) with a footprint that is
/// `width_m` wide there, measured across the ray: textures are filtered over the footprint. Normal and height maps
/// turn Surface::normal, never away from the viewer. Inline, so that a material without textures costs no more than
/// a copy.
[[nodiscard]] inline Surface surface_at(const Tracer& tracer, const BodyPoses& at, const Hit& hit,
                                        const Vec3& ray_direction, double width_m) noexcept {
    const Material& m = tracer.scene().materials[static_cast<std::size_t>(hit.material)];
    const bool no_lobe = m.kind == &kinds::lambert;
    Surface s{m.diffuse, no_lobe ? Rgb{} : m.specular, m.emission, m.exponent, &m, hit.shading_normal, hit.outside};
    if (is_textured(m)) apply_textures(tracer, at, hit, ray_direction, width_m, s);
    return s;
}

}  // namespace narpa
