/// base/pose.h - rotations and rigid transforms.
///
/// Quaternions are Hamilton, written (w, x, y, z), and rotate body coordinates into parent coordinates.
/// `T_world_body` takes body coordinates to world coordinates, so neighbours cancel:
/// `p_world = T_world_body * p_body`, `T_world_camera = T_world_body * T_body_camera`.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "base/vec3.h"

namespace narpa {

struct Quat {
    double w = 1, x = 0, y = 0, z = 0;

    [[nodiscard]] constexpr Vec3 vec() const { return {x, y, z}; }
    friend constexpr Quat operator*(const Quat& a, const Quat& b) {
        return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
                a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
    }
    /// Rotates a vector; the quaternion has norm 1.
    friend constexpr Vec3 operator*(const Quat& q, const Vec3& v) {
        const Vec3 t = 2.0 * cross(q.vec(), v);
        return v + q.w * t + cross(q.vec(), t);
    }
    friend constexpr bool operator==(const Quat&, const Quat&) = default;
};

constexpr double dot(const Quat& a, const Quat& b) {
    return a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z;
}
constexpr Quat conjugate(const Quat& q) {
    return {q.w, -q.x, -q.y, -q.z};
}
constexpr Quat operator-(const Quat& q) {
    return {-q.w, -q.x, -q.y, -q.z};
}
inline double norm(const Quat& q) {
    return std::sqrt(dot(q, q));
}
inline Quat normalized(const Quat& q) {
    const double s = 1.0 / norm(q);
    return {q.w * s, q.x * s, q.y * s, q.z * s};
}

/// Angle in radians between two attitudes, in [0, pi]; sign-free and exact to rounding for tiny angles.
inline double angle_between(const Quat& a, Quat b) {
    if (dot(a, b) < 0) b = -b;
    const Quat d{a.w - b.w, a.x - b.x, a.y - b.y, a.z - b.z}, s{a.w + b.w, a.x + b.x, a.y + b.y, a.z + b.z};
    return 4.0 * std::atan2(norm(d), norm(s));
}

/// Rotation by the vector `phi` (axis times angle, radians).
inline Quat exp_rotation(const Vec3& phi) {
    const double angle = norm(phi), half = 0.5 * angle;
    const double k = angle < 1e-8 ? 0.5 - angle * angle / 48.0 : std::sin(half) / angle;
    return {std::cos(half), k * phi.x, k * phi.y, k * phi.z};
}

/// Axis times angle (radians, in [0, pi]) of a rotation; the inverse of exp_rotation.
inline Vec3 rotation_vector(Quat q) {
    if (q.w < 0) q = -q;
    const double s = norm(q.vec());
    return q.vec() * (s < 1e-12 ? 2.0 : 2.0 * std::atan2(s, q.w) / s);
}

/// Shortest-arc spherical interpolation, u in [0, 1]; u outside extrapolates at the same rate.
inline Quat slerp(const Quat& a, Quat b, double u) {
    if (dot(a, b) < 0) b = -b;
    const Quat chord{b.w - a.w, b.x - a.x, b.y - a.y, b.z - a.z};
    const double chord2 = dot(chord, chord);
    double ka = 1 - u, kb = u;
    if (chord2 < 1e-6) {  // sin(k theta) / sin(theta) by its series, 1e-15 rad off
        ka *= 1 + chord2 / 6 * (1 - ka * ka);
        kb *= 1 + chord2 / 6 * (1 - kb * kb);
    } else {
        const double theta = 0.5 * angle_between(a, b), s = std::sin(theta);
        ka = std::sin(ka * theta) / s;
        kb = std::sin(kb * theta) / s;
    }
    return normalized(Quat{ka * a.w + kb * b.w, ka * a.x + kb * b.x, ka * a.y + kb * b.y, ka * a.z + kb * b.z});
}

/// The rotation whose matrix has these columns (an orthonormal, right-handed set).
inline Quat quat_from_columns(const Vec3& cx, const Vec3& cy, const Vec3& cz) {
    const double t = cx.x + cy.y + cz.z;
    Quat q;
    if (t > 0) {
        q = {1 + t, cy.z - cz.y, cz.x - cx.z, cx.y - cy.x};
    } else if (cx.x >= cy.y && cx.x >= cz.z) {
        q = {cy.z - cz.y, 1 + cx.x - cy.y - cz.z, cy.x + cx.y, cz.x + cx.z};
    } else if (cy.y >= cz.z) {
        q = {cz.x - cx.z, cy.x + cx.y, 1 - cx.x + cy.y - cz.z, cz.y + cy.z};
    } else {
        q = {cx.y - cy.x, cz.x + cx.z, cz.y + cy.z, 1 - cx.x - cy.y + cz.z};
    }
    return normalized(q);
}

/// The three columns of the rotation matrix of a unit quaternion.
inline std::array<Vec3, 3> columns(const Quat& q) {
    return {q * Vec3{1, 0, 0}, q * Vec3{0, 1, 0}, q * Vec3{0, 0, 1}};
}

/// A rigid transform: rotate, then translate.
struct Rigid3 {
    Quat q{};
    Vec3 t{};  ///< metres

    friend constexpr Vec3 operator*(const Rigid3& T, const Vec3& p) { return T.q * p + T.t; }
    friend constexpr Rigid3 operator*(const Rigid3& a, const Rigid3& b) { return {a.q * b.q, a.q * b.t + a.t}; }
    friend constexpr bool operator==(const Rigid3&, const Rigid3&) = default;
};

constexpr Rigid3 inverse(const Rigid3& T) {
    const Quat qi = conjugate(T.q);
    return {qi, -(qi * T.t)};
}

/// A body's rigid motion at one instant: pose, velocity (world axes), angular rate (body axes).
struct Motion {
    Rigid3 T_world_body{};
    Vec3 velocity_m_s{};
    Vec3 rate_rad_s{};
};

/// Extrapolates with constant velocity and body rate.
inline Motion extrapolate(const Motion& from, double dt_s) {
    if (dt_s == 0) return from;  // bit for bit
    Motion m = from;
    m.T_world_body.t += from.velocity_m_s * dt_s;
    m.T_world_body.q = normalized(from.T_world_body.q * exp_rotation(from.rate_rad_s * dt_s));
    return m;
}

}  // namespace narpa
