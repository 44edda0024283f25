/// rehearsal/dynamics/orbit_motion.h - relative motion of the chaser's centre of mass about the target's, which is
/// on a circular orbit, or fixed to the ground of a rotating planet.
#pragma once

#include <Eigen/Core>

#include "base/pose.h"
#include "estimator/pose/pose_estimate.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// The chaser's centre of mass relative to the target's, world axes (inertial).
struct Translation {
    Vec3 position_m{}, velocity_m_s{};
};

/// The state dt_s later. `acceleration_m_s2`: by the thrusters, world axes, constant (Clohessy-Wiltshire: constant
/// in LVLH, with the value of mid-step). Free and Clohessy-Wiltshire: exact, in closed form. Two bodies: the
/// target's circular orbit is exact; the gravity difference has the form of R. Battin ("An Introduction to the
/// Mathematics and Methods of Astrodynamics", 1999, section 8.5), which avoids cancellation against the orbit's
/// radius, and is integrated by RK4 in steps of at most a second: error 1e-12 of the distance after an orbit at 400
/// km. Surface: gravity with J2 minus the acceleration of the ground, in the same steps.
[[nodiscard]] Translation propagated(const Orbit& orbit, double t_s, double dt_s, const Vec3& acceleration_m_s2,
                                     const Translation& from);

/// The attractor relative to the target, world axes; it does not rotate.
[[nodiscard]] Motion attractor_motion(const Orbit& orbit, const Quat& q_world_attractor, double t_s);

struct Attitude {
    Quat q_world_body{};
    Vec3 rate_rad_s{};  ///< body axes, against inertial space
};

class RigidBody {
public:
    /// Inertia about the centre of mass, body axes; symmetric and positive definite.
    explicit RigidBody(const Eigen::Matrix3d& inertia_kg_m2);

    /// The state dt_s later; the torque is about the centre of mass, constant in body axes. Rates by RK4, attitude
    /// by the fourth-order Magnus expansion (A. Iserles, S. Norsett, 1999), in steps of at most 0.005 rad: a
    /// tumbling body keeps energy and momentum to 1e-10 over a hundred turns.
    [[nodiscard]] Attitude turned(Attitude from, const Vec3& torque_n_m, double dt_s) const;

private:
    Eigen::Matrix3d inertia_, inverse_;
};

}  // namespace narpa::rehearsal
