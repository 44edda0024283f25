/// renderer/geometry/sphere_roots.h - where a line meets a sphere, in double, without cancellation.
#pragma once

#include <cmath>
#include <limits>

#include "base/vec3.h"

namespace narpa {

struct SphereRoots {
    double near = 0, far = 0;  ///< multiples of the direction, near <= far; negative is behind the origin

    [[nodiscard]] bool any() const noexcept { return near <= far; }  ///< else both are NaN
};

/// The line o + t d against the sphere of this radius about the origin; d of any length but zero. The discriminant
/// is the squared half chord, from the point of closest approach; the smaller root comes from the product of the
/// roots. Source: E. Haines, J. Gunther, T. Akenine-Moller, "Precision Improvements for Ray/Sphere
/// Intersection", Ray Tracing Gems (2019), chapter 7. Without a branch, for loops over many rays.
inline SphereRoots sphere_roots(const Vec3& o, const Vec3& d, double radius) noexcept {
    const double a = dot(d, d), b = -dot(o, d);
    const Vec3 closest = o + (b / a) * d;
    const double half_chord2 = radius * radius - dot(closest, closest);  // negative: its root is NaN
    const double q = b + std::copysign(std::sqrt(a * half_chord2), b);
    const double far_from_zero = q / a;
    const double by_product = (dot(o, o) - radius * radius) / q;
    const double near_zero = q == 0 ? 0 : by_product;
    const bool in_order = near_zero <= far_from_zero;
    return {in_order ? near_zero : far_from_zero, in_order ? far_from_zero : near_zero};
}

/// Where a ray enters a bounding sphere about the origin, roughly; infinity where it misses. Without a branch.
inline double bounding_entry(const Vec3& o, const Vec3& unit_d, double radius) noexcept {
    const double b = -dot(o, unit_d);
    const Vec3 closest = o + b * unit_d;
    const double half_chord = std::sqrt(radius * radius - dot(closest, closest));  // NaN if the line misses
    return b + half_chord >= 0 ? b - half_chord : std::numeric_limits<double>::infinity();
}

}  // namespace narpa
