/// estimator/pose/pose_estimate.h - a relative pose and the definition of its error.
///
/// The state is `T_camera_body`: it takes the target's body coordinates to the camera's (x right, y down, z
/// forward). An error is a vector of six, (rotation rad, translation m), in camera axes and applied from the left:
/// truth = {exp_rotation(rotation) * q, t + translation}. All covariances and bounds are of this vector.
#pragma once

#include <Eigen/Core>
#include <random>

#include "base/pose.h"

namespace narpa {

/// In installed headers, matrices whose alignment would depend on the compiler's vector flags have none: a user may
/// compile with other flags than narpa.
template <int rows, int columns>
using UnalignedMatrix = Eigen::Matrix<double, rows, columns, Eigen::DontAlign>;
using Vector6 = UnalignedMatrix<6, 1>;
using Matrix6 = UnalignedMatrix<6, 6>;

inline Eigen::Vector3d to_eigen(const Vec3& v) {
    return {v.x, v.y, v.z};
}
/// R(q) v = q * v.
inline Eigen::Matrix3d rotation_matrix(const Quat& q) {
    const auto c = columns(q);
    Eigen::Matrix3d R;
    R << to_eigen(c[0]), to_eigen(c[1]), to_eigen(c[2]);
    return R;
}
/// skew(a) b = a x b.
inline Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
    Eigen::Matrix3d m;
    m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return m;
}
inline Vec3 to_vec3(const Eigen::Vector3d& v) {
    return {v.x(), v.y(), v.z()};
}

/// The pose that lies an error away: {exp_rotation(error[0..2]) * T.q, T.t + error[3..5]}.
[[nodiscard]] Rigid3 displaced(const Rigid3& T, const Vector6& error);
/// The error that leads from one pose to the other: displaced(from, error_between(from, to)) is `to`. The rotation
/// is in [0, pi] and does not depend on the quaternions' signs.
[[nodiscard]] Vector6 error_between(const Rigid3& from, const Rigid3& to);

inline constexpr double kDegree = 3.14159265358979323846 / 180;  ///< radians
/// Random error of this size in rotation and in translation, each in a random direction.
[[nodiscard]] Vector6 random_error(double rotation_rad, double translation_m, std::mt19937_64& random);

/// Square roots of the summed variances of an error's rotation, rad, and translation, m.
[[nodiscard]] double rotation_sigma(const Matrix6& covariance);
[[nodiscard]] double position_sigma(const Matrix6& covariance);

/// Normalised estimation error squared, e' C^-1 e: chi-square with six degrees of freedom if the covariance is
/// right. Infinite if it is not positive definite.
[[nodiscard]] double normalised_error_squared(const Vector6& error, const Matrix6& covariance);

/// The covariance of T_a_b * T_b_c, given that of T_a_b; T_b_c is exact.
[[nodiscard]] Matrix6 covariance_of_product(const Rigid3& T_a_b, const Matrix6& covariance_of_a_b,
                                            const Rigid3& T_b_c);

/// The covariance of the same estimate in other axes: of T_a_b, given that of T_c_b, where a and c lie apart
/// by an exact T_a_c with this rotation.
[[nodiscard]] Matrix6 covariance_in_other_axes(const Quat& q_a_c, const Matrix6& covariance);

}  // namespace narpa
