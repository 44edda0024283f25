/// renderer/material/bsdf.h - how a point of a surface sends light on.
///
/// Directions are unit, in the world's frame, and point away from the surface: n is the shading normal, v goes to
/// where the light is wanted (the viewer's side: n.v > 0 but for grazing shading normals), l to where it comes
/// from. Everything is radiometric: f in 1/sr, no cosine in it. Parameters of each kind: Material in scene.h.
///
/// kind             f(l, v); a: phase angle between l and v    l chosen by           keeps energy and is reciprocal
/// lambert          kd / pi                                    cosine                for kd <= 1
/// phong            kd / pi + ks (n + 2) / (2 pi) (r.v)^n      cosine, lobe          for kd + ks <= 1
/// phong_classic    (kd + ks (r.v)^n / n.l) / pi               cosine                neither: direct light only
/// mirror           ks, from 2 (n.v) n - v alone               that direction        for ks <= 1
/// dielectric       Fresnel and Snell                          one of the two        radiance goes as index squared
/// ggx              facets (over diffuse), every bounce        visible normals       for base <= 1, ior in 1..3
/// lommel_seeliger  w p(a) / (4 pi (n.l + n.v))                p                     for w <= 1
/// lunar_lambert    A (2 L(a) / (n.l + n.v) + 1 - L(a)) / pi   even, cosine          for A <= 0.586
/// hapke            Hapke 2012                                 p, cosine             for soils; see albedo.h
///
/// Sources: E. Lafortune, Y. Willems, "Using the Modified Phong Reflectance Model", 1994 (phong); the paper,
/// section III (phong_classic: I_S = I_D = E / pi, so that kd is an albedo); fresnel.h; ggx.cpp; regolith.h;
/// hapke.cpp. What albedo any of them reaches: `largest_albedo` in albedo.h.
#pragma once

#include <array>

#include "renderer/material/material.h"

namespace narpa {

/// A Surface without a material of its own is Phong by its own numbers (Lambert while specular is 0).
inline const Material kPlainMaterial{.name = {}, .kind = Material::Kind::phong};

/// A material at one point, its textures looked up.
struct Surface {
    Rgb diffuse{};   ///< kd, base colour, normal albedo or w, as the kind says
    Rgb specular{};  ///< ks of phong; other kinds have theirs in the material
    Rgb emission{};
    float exponent = 1;                          ///< of phong
    const Material* material = &kPlainMaterial;  ///< what does not vary over the surface; never null
    Vec3 normal{};                               ///< shading normal, unit, world, on the viewer's side
    bool outside = true;  ///< the viewer is on the outer side of the surface (for refraction)
};

/// Does the material reflect or refract in single directions only (mirror, dielectric)? Then f is 0 everywhere and
/// light is found by `sample_bsdf` alone.
[[nodiscard]] bool is_specular(const Material& m) noexcept;

/// Reflected radiance per irradiance, 1/sr; 0 unless l and v both lie on the side of n, and 0 for specular kinds.
[[nodiscard]] Rgb bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

/// Density per solid angle with which `sample_bsdf` chooses l, given v; 0 for specular kinds. Over the hemisphere
/// it integrates to 1, to less for ggx, some of whose mirror directions fall below the surface and end the path.
[[nodiscard]] double bsdf_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

struct BsdfSample {
    Vec3 l{};                  ///< where the path goes on
    Rgb weight{};              ///< f |n.l| / pdf; all zero: the path ends
    double pdf = 0;            ///< per solid angle; 0 where `specular`
    bool specular = false;     ///< a single direction: no light sampling can find it
    bool transmitted = false;  ///< goes on at the other side of the surface
    /// The part of `weight` that comes of radiance growing with the index squared, 1 unless `transmitted`; it
    /// cancels when the light leaves the body, so Russian roulette does well to judge a path by its weights without
    /// it.
    float radiance_scale = 1;
};
/// Chooses l in proportion to f |n.l|, as far as the kind allows; u: three numbers in [0, 1), u[0] chooses the
/// lobe.
[[nodiscard]] BsdfSample sample_bsdf(const Surface& s, const Vec3& n, const Vec3& v,
                                     const std::array<double, 3>& u) noexcept;

/// What `ambient_reflectance` gives for the kinds after phong.
[[nodiscard]] Rgb other_ambient_reflectance(const Surface& s) noexcept;

/// Radiance sent back under an even environment of radiance 1, averaged over the viewer's directions: what
/// `[ambient]` is multiplied with in direct light. Phong's lobe counts as at normal incidence, where its albedo is
/// exactly ks; phong_classic has its ka.
[[nodiscard]] inline Rgb ambient_reflectance(const Surface& s) noexcept {
    return s.material->kind <= Material::Kind::phong ? s.diffuse + s.specular : other_ambient_reflectance(s);
}

}  // namespace narpa
