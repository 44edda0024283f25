/// renderer/material/bsdf.h - scattering of light at a point of a surface.
///
/// Directions are unit, in world axes, and point away from the surface: n is the shading normal, v points to the
/// viewer (n.v > 0 except for grazing shading normals), l to where the light comes from. All quantities are
/// radiometric: f in 1/sr, without the cosine. Parameters of each kind: Material in material.h.
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
/// akimov           A D(a, beta, gamma) / (pi n.l)             even                  for A <= 0.589
/// hapke            Hapke 2012                                 p, cosine             for soils; see albedo.h
///
/// Sources: E. Lafortune, Y. Willems, "Using the Modified Phong Reflectance Model", 1994 (phong); the paper,
/// section III (phong_classic: I_S = I_D = E / pi, so that kd is an albedo); fresnel.h; ggx.cpp; regolith.h;
/// akimov.cpp; hapke.cpp. What albedo any of them reaches: `largest_albedo` in albedo.h.
#pragma once

#include <array>

#include "renderer/material/material.h"

namespace narpa {

/// Default material of a Surface: Phong with the Surface's own values (Lambert while specular is 0).
inline const Material kPlainMaterial{.name = {}, .kind = &kinds::phong};

/// A material at one point, its textures looked up.
struct Surface {
    Rgb diffuse{};   ///< kd, base colour, normal albedo or w, depending on the kind
    Rgb specular{};  ///< ks of phong; other kinds take it from the material
    Rgb emission{};
    float exponent = 1;                          ///< of phong
    const Material* material = &kPlainMaterial;  ///< parameters that do not vary over the surface; never null
    Vec3 normal{};                               ///< shading normal, unit, world, on the viewer's side
    bool outside = true;  ///< the viewer is on the outer side of the surface (for refraction)
};

/// True if the BSDF is a delta distribution (mirror, dielectric). Then f is 0 everywhere and only `sample_bsdf`
/// finds light.
[[nodiscard]] bool is_specular(const Material& m) noexcept;
/// True if f is kd / pi, or that and Phong's lobe of ks: BsdfKind::lambert_or_phong.
[[nodiscard]] bool is_lambert_or_phong(const Material& m) noexcept;
/// ks of a lobe; 0 for kinds without one.
[[nodiscard]] Rgb lobe_colour(const Material& m) noexcept;

/// Reflected radiance per irradiance, 1/sr; 0 unless l and v both lie on the side of n, and 0 for specular kinds.
[[nodiscard]] Rgb bsdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

/// Density per solid angle with which `sample_bsdf` chooses l, given v; 0 for specular kinds. Over the hemisphere
/// it integrates to 1, to less for ggx, some of whose mirror directions fall below the surface and end the path.
[[nodiscard]] double bsdf_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

struct BsdfSample {
    Vec3 l{};                  ///< next direction of the path
    Rgb weight{};              ///< f |n.l| / pdf; all zero: the path ends
    double pdf = 0;            ///< per solid angle; 0 where `specular`
    bool specular = false;     ///< a single direction: no light sampling can find it
    bool transmitted = false;  ///< continues on the other side of the surface
    /// The factor of `weight` from radiance scaling with the index squared, 1 unless `transmitted`. It cancels when
    /// the light leaves the body, so Russian roulette should divide it out.
    float radiance_scale = 1;
};
/// Samples l in proportion to f |n.l|, as far as the kind allows; u: three numbers in [0, 1), u[0] selects the
/// lobe.
[[nodiscard]] BsdfSample sample_bsdf(const Surface& s, const Vec3& n, const Vec3& v,
                                     const std::array<double, 3>& u) noexcept;

/// Reflected radiance under a uniform environment of radiance 1, averaged over the viewer's directions: the factor
/// of `[ambient]` in direct light. Phong's lobe counts as at normal incidence, where its albedo is exactly ks;
/// phong_classic uses its ka.
[[nodiscard]] Rgb ambient_reflectance(const Surface& s) noexcept;

}  // namespace narpa
