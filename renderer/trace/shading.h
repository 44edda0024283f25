/// renderer/trace/shading.h - how a surface sends light on.
#pragma once

#include "renderer/trace/tracer.h"

namespace narpa {

/// A material at one point, its texture looked up.
struct Surface {
    Rgb diffuse{}, specular{}, emission{};
    float exponent = 1;
};
[[nodiscard]] Surface surface_at(const Scene& scene, const Hit& hit) noexcept;

/// Bilinear, repeating; (0, 0) is the bottom left corner of the bottom left texel, v up.
[[nodiscard]] Rgb texture_lookup(const Texture& texture, float u, float v) noexcept;

/// Reflected radiance per irradiance, 1/sr, with n, l (to the light) and v (to the viewer) unit and outwards; zero
/// unless both lie above the surface. Lambert: kd / pi. Phong in the form that keeps energy and reciprocity:
/// kd / pi + ks (n + 2) / (2 pi) max(0, R.V)^n (E. Lafortune, Y. Willems, "Using the modified Phong
/// reflectance model for physically based rendering", 1994).
[[nodiscard]] Rgb brdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;

/// Radiance sent back under an even environment of radiance 1. The Phong lobe counts as at normal incidence, where
/// its albedo is exactly ks: an upper bound elsewhere.
[[nodiscard]] inline Rgb ambient_reflectance(const Surface& s) noexcept {
    return s.diffuse + s.specular;
}

}  // namespace narpa
