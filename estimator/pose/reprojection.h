/// estimator/pose/reprojection.h - how the image of a body's point moves with the pose.
#pragma once

#include "estimator/pose/pose_estimate.h"
#include "renderer/camera/camera_model.h"

namespace narpa {

using Matrix26 = Eigen::Matrix<double, 2, 6>;

[[nodiscard]] inline Eigen::Matrix<double, 2, 3> to_eigen(const ProjectionJacobian& J) {
    Eigen::Matrix<double, 2, 3> m;
    m << J.x.x, J.x.y, J.x.z, J.y.x, J.y.y, J.y.z;
    return m;
}

/// Of the image point of `body_m`, which has one, by the pose's error (pose_estimate.h): px per (rad, m).
[[nodiscard]] inline Matrix26 reprojection_jacobian(const CameraModel& model, const Rigid3& T_camera_body,
                                                    const Vec3& body_m) {
    const Vec3 a = T_camera_body.q * body_m;
    const ProjectionJacobian J = model.jacobian(a + T_camera_body.t);
    Matrix26 m;
    m.leftCols<3>() << to_eigen(cross(a, J.x)).transpose(), to_eigen(cross(a, J.y)).transpose();
    m.rightCols<3>() = to_eigen(J);
    return m;
}

}  // namespace narpa
