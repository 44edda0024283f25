#include "rehearsal/dynamics/rigid_body.h"

#include <Eigen/LU>

#include "estimator/filter/motion_model.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa::rehearsal {
namespace {

constexpr double kLargestTurnRad = 0.005;

}  // namespace

RigidBody::RigidBody(const Eigen::Matrix3d& inertia_kg_m2)
    : inertia_(inertia_kg_m2), inverse_(inertia_kg_m2.inverse()) {}

Attitude RigidBody::turned(Attitude from, const Vec3& torque_n_m, double dt_s) const {
    const Eigen::Vector3d torque = to_eigen(torque_n_m);
    Eigen::Vector3d w = to_eigen(from.rate_rad_s);
    const double turn_rad = w.norm() * dt_s + 0.5 * (inverse_ * torque).norm() * dt_s * dt_s;
    const int steps = 1 + static_cast<int>(turn_rad / kLargestTurnRad);
    const double h = dt_s / steps;
    for (int i = 0; i < steps; ++i) {
        const RotationStep step = rotation_step(inertia_, inverse_, torque, w, h);
        from.q_world_body = from.q_world_body * exp_rotation(to_vec3(step.turn_rad));
        w = step.rate_rad_s;
    }
    return {normalized(from.q_world_body), to_vec3(w)};
}

}  // namespace narpa::rehearsal
