/// renderer/geometry/ellipsoid.h - an exact sphere or ellipsoid about its body's origin, in the body's frame, in
/// double.
///
/// Squeezed along its axes it is the sphere of its largest semi-axis, and lines stay lines: it is solved there,
/// with a direction that is no longer unit. A sphere is squeezed by exactly 1, so nothing is rounded for it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "renderer/geometry/sphere_roots.h"

namespace narpa {

/// Where a ray meets the surface.
struct Crossing {
    double range = std::numeric_limits<double>::infinity();  ///< multiples of the direction; infinity: it does not
    bool outside = true;                                     ///< met from the outer side
};

class EllipsoidShape {
public:
    explicit EllipsoidShape(const Vec3& semi_axes_m)
        : semi_axes_m_(semi_axes_m),
          radius_m_(std::max({semi_axes_m.x, semi_axes_m.y, semi_axes_m.z})),
          squeeze_{radius_m_ / semi_axes_m.x, radius_m_ / semi_axes_m.y, radius_m_ / semi_axes_m.z} {}

    /// Largest semi-axis, metres.
    [[nodiscard]] double radius_m() const noexcept { return radius_m_; }

    /// The nearest crossing that is not behind the ray. Without a branch, as all that follows, for loops over many
    /// rays.
    [[nodiscard]] Crossing first_crossing(const Vec3& o, const Vec3& d) const noexcept {
        const SphereRoots roots = sphere_roots(o * squeeze_, d * squeeze_, radius_m_);
        const bool outside = roots.near >= 0;
        const double ahead = roots.far >= 0 ? roots.far : kInfinity;
        return {outside ? roots.near : ahead, outside};
    }

    /// As above for a ray that leaves the surface at `start`. The shape is convex: from its outer side the ray
    /// meets it only by starting into it, from its inner side it meets the other end of the chord. Both starts are
    /// at range 0.
    [[nodiscard]] Crossing own_crossing(const Vec3& start, const Vec3& d, bool outside) const noexcept {
        const Vec3 o = start * squeeze_, e = d * squeeze_;
        const double up = dot(o, e), chord = std::max(0.0, -2 * up / dot(e, e));
        const double inwards = up < 0 ? 0 : kInfinity;
        return {outside ? inwards : chord, outside};
    }

    /// Outward, unit.
    [[nodiscard]] Vec3 normal(const Vec3& p) const noexcept { return normalized(p * squeeze_ * squeeze_); }

    /// The point of the surface towards which p lies, seen from the centre of the squeezed sphere.
    [[nodiscard]] Vec3 onto_surface(const Vec3& p) const noexcept {
        const Vec3 q = p * squeeze_;
        return (1 / norm(q)) * q * semi_axes_m_;
    }

    /// Texture coordinates where this is the outward normal: its longitude from +x towards +y and its latitude,
    /// which on an ellipsoid is the geodetic one of maps; v = 1 at +z.
    [[nodiscard]] static std::array<double, 2> uv(const Vec3& n) noexcept {
        const double colatitude = std::atan2(std::hypot(n.x, n.y), n.z), longitude = std::atan2(n.y, n.x);
        const double u = longitude / (2 * std::numbers::pi);
        return {u < 0 ? u + 1 : u, 1 - colatitude / std::numbers::pi};
    }

    /// Metres along the surface per unit of u and of v where this is the outward normal. At a pole u turns on the
    /// spot, and v runs along the meridian of u = 0.
    [[nodiscard]] std::array<Vec3, 2> per_uv(const Vec3& n) const noexcept {
        const double s = std::hypot(n.x, n.y), cos_longitude = s > 0 ? n.x / s : 1,
                     sin_longitude = s > 0 ? n.y / s : 0;
        const Vec3 dn_du = 2 * std::numbers::pi * Vec3{-n.y, n.x, 0};
        const Vec3 dn_dv = -std::numbers::pi * Vec3{n.z * cos_longitude, n.z * sin_longitude, -s};
        // The point whose normal is n: p = A n / h, A = diag(semi-axes^2), h^2 = n.A n.
        const Vec3 a2 = semi_axes_m_ * semi_axes_m_, a2_n = a2 * n;
        const double h = std::sqrt(dot(n, a2_n));
        const auto dp = [&](const Vec3& dn) { return (1 / h) * (a2 * dn - (dot(a2_n, dn) / (h * h)) * a2_n); };
        return {dp(dn_du), dp(dn_dv)};
    }

private:
    static constexpr double kInfinity = std::numeric_limits<double>::infinity();

    Vec3 semi_axes_m_;
    double radius_m_;
    Vec3 squeeze_;  ///< radius over semi-axes
};

}  // namespace narpa
