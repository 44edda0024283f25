/// tests/estimator/pnp/crp.h - classical Rodrigues parameters, and the image formation that the paper
/// differentiates by them.
///
/// q = axis * tan(angle / 2). R(q) = (I + [q x])^-1 (I - [q x]) is the passive direction-cosine matrix: it takes
/// object coordinates to camera coordinates, b = R(q) a + t, and is the transpose of the rotation by `angle` about
/// `axis`. Half a turn has no finite q, and there is no shadow set to change to (q and -q of the quaternion have
/// the same one): solvers keep a quaternion and use q as an increment only (pnp_refine.h).
///
/// Source: the paper, section VI and the appendix on the Jacobian, with its misprints mended: R33 is
/// 1 - q1^2 - q2^2 + q3^2; the second rows of J_f have h5 x + h6 y + h7 z + h8; dg9/dq3 is positive; J_f is 2n x 12
/// and J_g 12 x 6; the focal length is in the first eight of the h.
#pragma once

#include <Eigen/Core>
#include <span>

#include "base/pose.h"

namespace narpa {

/// Row-major 3 x 4: diag(f, f, 1) [R(q) | t].
using ProjectionVector = Eigen::Matrix<double, 12, 1>;

[[nodiscard]] Eigen::Matrix3d crp_matrix(const Eigen::Vector3d& q);
/// Row 3 i + j, column k: dR_ij / dq_k.
[[nodiscard]] Eigen::Matrix<double, 9, 3> crp_matrix_derivative(const Eigen::Vector3d& q);

/// The quaternion that turns a vector as R(q) does: what a Rigid3 has for the same attitude.
[[nodiscard]] Quat quaternion_from_crp(const Eigen::Vector3d& q);
/// Its inverse; grows without bound towards half a turn and is not finite there.
[[nodiscard]] Eigen::Vector3d crp_from_quaternion(const Quat& q);

/// g: (q, t) -> h, and its derivative J_g by (q1, q2, q3, t1, t2, t3).
[[nodiscard]] ProjectionVector projection_vector(const Eigen::Vector3d& q, const Eigen::Vector3d& t_m, double f_px);
[[nodiscard]] Eigen::Matrix<double, 12, 6> projection_vector_derivative(const Eigen::Vector3d& q, double f_px);

/// f: h -> (u1, v1, u2, v2 ...), pixels from the principal point, and its derivative J_f. A point in the camera's
/// plane makes them infinite.
[[nodiscard]] Eigen::VectorXd image_points(const ProjectionVector& h, std::span<const Vec3> points_m);
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, 12> image_points_derivative(const ProjectionVector& h,
                                                                                std::span<const Vec3> points_m);

}  // namespace narpa
