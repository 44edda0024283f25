/// renderer/material/bsdf.h - how a point of a surface sends light on.
///
/// Directions are unit, in the world's frame, and point away from the surface: n is the shading normal, v goes to
/// where the light is wanted (the viewer's side: n.v > 0 but for grazing shading normals), l to where it comes
/// from. Everything is radiometric: f in 1/sr, no cosine in it. Kinds and their parameters: Material in scene.h;
/// sources stand beside each form.
#pragma once

#include <array>

#include "renderer/scene/scene.h"

namespace narpa {

/// A material at one point, its textures looked up.
struct Surface {
    Rgb diffuse{}, specular{}, emission{};
    float exponent = 1;
    const Material* material = nullptr;  ///< what does not vary over the surface
    Vec3 normal{};                       ///< shading normal, unit, world, on the viewer's side
    bool outside = true;                 ///< the viewer is on the outer side of the surface (for refraction)
};

/// Does the material reflect or refract in single directions only (mirror, dielectric)? Then f is 0 everywhere and
/// light is found by `sample_bsdf` alone.
[[nodiscard]] bool is_specular(const Material& m) noexcept;

/// Reflected radiance per irradiance, 1/sr; 0 unless l and v both lie on the side of n, and 0 for specular kinds.
[[nodiscard]] Rgb bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

/// Density per solid angle with which `sample_bsdf` chooses l, given v; 0 for specular kinds.
[[nodiscard]] double bsdf_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

struct BsdfSample {
    Vec3 l{};                  ///< where the path goes on
    Rgb weight{};              ///< f |n.l| / pdf; all zero: the path ends
    double pdf = 0;            ///< per solid angle; 0 where `specular`
    bool specular = false;     ///< a single direction: no light sampling can find it
    bool transmitted = false;  ///< goes on at the other side of the surface
};
/// Chooses l in proportion to f |n.l|, as far as the kind allows; u are three numbers in [0, 1): u[0] chooses among lobes.
[[nodiscard]] BsdfSample sample_bsdf(const Surface& s, const Vec3& n, const Vec3& v,
                                     const std::array<double, 3>& u) noexcept;

/// Radiance sent back under an even environment of radiance 1, or an upper bound of it: what `[ambient]` is multiplied
/// with in direct light. Phong's lobe counts as at normal incidence, where its albedo is exactly ks.
[[nodiscard]] Rgb ambient_reflectance(const Surface& s) noexcept;

}  // namespace narpa
