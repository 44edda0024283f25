/// rehearsal/dynamics/rigid_body.h - rotation of a rigid body under a torque.
#pragma once

#include <Eigen/Core>

#include "base/pose.h"

namespace narpa::rehearsal {

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
