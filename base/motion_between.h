/// base/motion_between.h - the motion of a body between two samples of it.
///
/// Cubic Hermite in position through both velocities (straight when both are zero), slerp in attitude: by the
/// shortest arc, or with the whole turns that the rates state where these are of more than half a turn between the
/// samples. Velocity and rate are the derivatives of the pose.
#pragma once

#include <cmath>

#include "base/constants.h"
#include "base/pose.h"

namespace narpa {

/// Rotation from `a` to `b` within `h_s`, in the frame of `a`: by the shortest arc, or, where the rates are of more
/// than half a turn, with the number of whole turns that comes closest to them.
inline Vec3 rotation_between(const Motion& a, const Motion& b, double h_s) {
    const Vec3 shortest = rotation_vector(conjugate(a.T_world_body.q) * b.T_world_body.q);
    const Vec3 stated = (0.5 * h_s) * (a.rate_rad_s + b.rate_rad_s);
    if (!(norm(stated) > kPi)) return shortest;
    const double angle = norm(shortest);
    const Vec3 axis = angle > 1e-9 ? shortest / angle : stated / norm(stated);
    return shortest + (2 * kPi * std::round((dot(stated, axis) - angle) / (2 * kPi))) * axis;
}

/// `h_s` > 0: from `a` to `b`; `u`, from 0 to 1: the part of it that has passed.
inline Motion motion_between(const Motion& a, const Motion& b, double h_s, double u) {
    const double u2 = u * u;
    const Rigid3 &Ta = a.T_world_body, &Tb = b.T_world_body;
    const Vec3 chord = Tb.t - Ta.t, va = a.velocity_m_s, vb = b.velocity_m_s;
    Motion m;
    if (va == Vec3{} && vb == Vec3{}) {
        m.T_world_body.t = Ta.t + u * chord;
        m.velocity_m_s = chord / h_s;
    } else {
        m.T_world_body.t =
            Ta.t + (u2 * (3 - 2 * u)) * chord + (h_s * u * (1 - u) * (1 - u)) * va - (h_s * u2 * (1 - u)) * vb;
        m.velocity_m_s = (6 * u * (1 - u) / h_s) * chord + ((1 - u) * (1 - 3 * u)) * va + (u * (3 * u - 2)) * vb;
    }
    const Vec3 rotation = rotation_between(a, b, h_s);
    m.T_world_body.q = norm(rotation) > kPi ? normalized(Ta.q * exp_rotation(u * rotation)) : slerp(Ta.q, Tb.q, u);
    m.rate_rad_s = rotation / h_s;
    return m;
}

}  // namespace narpa
