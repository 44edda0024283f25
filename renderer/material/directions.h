/// renderer/material/directions.h - sampling of directions about an axis.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/fast_math.h"
#include "base/vec3.h"

namespace narpa {

/// Two directions that make a right-handed frame with the unit vector z (T. Duff et al., "Building an Orthonormal
/// Basis, Revisited", JCGT 6(1), 2017).
struct Basis {
    Vec3 x, y, z;

    explicit Basis(const Vec3& axis) noexcept : z(axis) {
        const double sign = std::copysign(1.0, z.z), a = -1 / (sign + z.z), b = z.x * z.y * a;
        x = {1 + sign * z.x * z.x * a, sign * b, -sign * z.x};
        y = {b, sign + z.y * z.y * a, -z.y};
    }
    [[nodiscard]] Vec3 to_world(const Vec3& local) const noexcept {
        return local.x * x + local.y * y + local.z * z;
    }
    [[nodiscard]] Vec3 to_local(const Vec3& world) const noexcept {
        return {dot(world, x), dot(world, y), dot(world, z)};
    }
};

/// Unit vector at the angle from the z axis with this sine and cosine, and the azimuth 2 pi u.
[[nodiscard]] inline Vec3 direction_at(double sine, double cosine, double u) noexcept {
    const auto [sin, cos] = sincos_of_turns(u);
    return {sine * cos, sine * sin, cosine};
}
[[nodiscard]] inline Vec3 direction_at(double cosine, double u) noexcept {
    return direction_at(std::sqrt(std::max(0.0, 1 - cosine * cosine)), cosine, u);
}

/// Samples a direction about n with density cosine / pi.
[[nodiscard]] inline Vec3 cosine_direction(const Vec3& n, double u1, double u2) noexcept {
    return Basis(n).to_world(direction_at(std::sqrt(1 - u1), u2));
}

/// Mirrors a direction below the surface to above it: its light is not lost, and the densities of the two
/// directions add.
[[nodiscard]] inline Vec3 folded(const Vec3& l, const Vec3& n) noexcept {
    const double below = dot(n, l);
    return below < 0 ? l - 2 * below * n : l;
}

}  // namespace narpa
