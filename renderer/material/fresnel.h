/// renderer/material/fresnel.h - reflection and refraction at a smooth interface between two transparent media.
///
/// Here `v` points towards the surface and `n` (unit) against it: v.n <= 0. The index `eta` is that of the far side
/// over that of the side where v comes from. Source: M. Born, E. Wolf, "Principles of Optics", sections 1.5.2
/// and 1.5.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "base/vec3.h"

namespace narpa {

/// The mirror direction v - 2 (v.n) n.
[[nodiscard]] inline Vec3 reflect(const Vec3& v, const Vec3& n) noexcept {
    return v - 2 * dot(v, n) * n;
}

/// Cosine of the refracted ray's angle to the normal by Snell's law; negative at total internal reflection. `cos_i`
/// >= 0.
[[nodiscard]] inline double refracted_cosine(double cos_i, double eta) noexcept {
    const double cos2_t = 1 - (1 - cos_i) * (1 + cos_i) / (eta * eta);
    return cos2_t < 0 ? -1 : std::sqrt(cos2_t);
}

/// The refracted direction, given its cosine from `refracted_cosine` (>= 0). Unlike the form with a tangent vector
/// it holds at normal incidence.
[[nodiscard]] inline Vec3 refract(const Vec3& v, const Vec3& n, double eta, double cos_t) noexcept {
    return v / eta + (-dot(v, n) / eta - cos_t) * n;
}

/// Fresnel's reflectance for unpolarised light; 1 at total internal reflection.
[[nodiscard]] inline double fresnel_dielectric(double cos_i, double eta) noexcept {
    const double cos_t = refracted_cosine(cos_i, eta);
    if (cos_t < 0 || cos_i <= 0) return 1;
    const double s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    const double p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return 0.5 * (s * s + p * p);
}

/// Reflectance at normal incidence.
[[nodiscard]] inline double normal_reflectance(double eta) noexcept {
    const double r = (eta - 1) / (eta + 1);
    return r * r;
}

/// C. Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", 1994: r0 + (1 - r0) (1 - cosine)^5.
template <class T>
[[nodiscard]] T schlick(const T& r0, double cosine) noexcept {
    const double x = std::clamp(1 - cosine, 0.0, 1.0), x2 = x * x;
    const double weight = x2 * x2 * x;
    if constexpr (std::is_arithmetic_v<T>)
        return static_cast<T>(r0 + (1 - r0) * weight);
    else
        return r0 + (T{1, 1, 1} - r0) * static_cast<float>(weight);
}

/// Schlick's approximation with the angle on the optically thinner side, where it holds; 1 at total internal
/// reflection. Differs from `fresnel_dielectric` by at most 0.060 (n = 1.33), 0.036 (1.5), 0.074 (2.4).
[[nodiscard]] inline double fresnel_schlick(double cos_i, double eta) noexcept {
    const double cosine = eta < 1 ? refracted_cosine(cos_i, eta) : cos_i;
    return cosine < 0 ? 1 : schlick(normal_reflectance(eta), cosine);
}

}  // namespace narpa
