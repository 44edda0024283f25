#include "rehearsal/dynamics/rigid_body.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "estimator/pose/pose_estimate.h"

namespace narpa::rehearsal {
namespace {

constexpr double kLargestTurnRad = 0.005;

}  // namespace

RigidBody::RigidBody(const Eigen::Matrix3d& inertia_kg_m2)
    : inertia_(inertia_kg_m2), inverse_(inertia_kg_m2.inverse()) {}

Attitude RigidBody::turned(Attitude from, const Vec3& torque_n_m, double dt_s) const {
    const Eigen::Vector3d torque = to_eigen(torque_n_m);
    const auto acceleration = [&](const Eigen::Vector3d& w) -> Eigen::Vector3d {
        return inverse_ * (torque - w.cross(inertia_ * w));
    };
    Eigen::Vector3d w = to_eigen(from.rate_rad_s);
    const double turn_rad = w.norm() * dt_s + 0.5 * (inverse_ * torque).norm() * dt_s * dt_s;
    const int steps = 1 + static_cast<int>(turn_rad / kLargestTurnRad);
    const double h = dt_s / steps;
    for (int i = 0; i < steps; ++i) {
        const Eigen::Vector3d k1 = acceleration(w), k2 = acceleration(w + 0.5 * h * k1);
        const Eigen::Vector3d k3 = acceleration(w + 0.5 * h * k2), k4 = acceleration(w + h * k3);
        const Eigen::Vector3d next = w + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
        const Eigen::Vector3d middle = 0.5 * (w + next) + h / 8 * (k1 - acceleration(next));  // cubic
        const Eigen::Vector3d turn = h / 6 * (w + 4 * middle + next) + h * h / 12 * w.cross(next);
        from.q_world_body = from.q_world_body * exp_rotation(to_vec3(turn));
        w = next;
    }
    return {normalized(from.q_world_body), to_vec3(w)};
}

}  // namespace narpa::rehearsal
