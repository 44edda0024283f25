/// estimator/pose/apparent_motion.h - the target's motion as a sensor sees it while it measures.
#pragma once

#include "base/pose.h"

namespace narpa {

/// Motion of a target in a sensor's axes, during a sweep or an exposure: at t_s after the time of the pose the
/// target's attitude is exp_rotation(t_s * rate) * q, and its origin is at t + t_s * velocity.
struct ApparentMotion {
    Vec3 velocity_m_s{};
    Vec3 rate_rad_s{};

    friend bool operator==(const ApparentMotion&, const ApparentMotion&) = default;
};

[[nodiscard]] inline Rigid3 moved(const Rigid3& T_sensor_target, const ApparentMotion& motion, double t_s) {
    return {normalized(exp_rotation(t_s * motion.rate_rad_s) * T_sensor_target.q),
            T_sensor_target.t + t_s * motion.velocity_m_s};
}
/// Motion from one pose to another dt_s later.
[[nodiscard]] inline ApparentMotion motion_between(const Rigid3& T_sensor_target, const Rigid3& later,
                                                   double dt_s) {
    return {(later.t - T_sensor_target.t) / dt_s, rotation_vector(later.q * conjugate(T_sensor_target.q)) / dt_s};
}
/// The same motion in other axes that are fixed relative to the first.
[[nodiscard]] inline ApparentMotion rotated(const Quat& q, const ApparentMotion& motion) {
    return {q * motion.velocity_m_s, q * motion.rate_rad_s};
}

}  // namespace narpa
