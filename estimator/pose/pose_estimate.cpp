#include "estimator/pose/pose_estimate.h"

#include <cmath>
#include <limits>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
Rigid3 displaced(const Rigid3& T, const Vector6& error) {
    return {normalized(exp_rotation({error[0], error[1], error[2]}) * T.q),
            T.t + Vec3{error[3], error[4], error[5]}};
}

Vector6 error_between(const Rigid3& from, const Rigid3& to) {
    Vector6 e;
    e << to_eigen(rotation_vector(to.q * conjugate(from.q))), to_eigen(to.t - from.t);
    return e;
}

Vector6 random_error(double rotation_rad, double translation_m, std::mt19937_64& random) {
    std::normal_distribution<double> normal;
    const auto direction = [&] {
        const double x = normal(random), y = normal(random), z = normal(random);
        return Eigen::Vector3d(x, y, z).normalized();
    };
    Vector6 error;
    error.head<3>() = rotation_rad * direction();
    error.tail<3>() = translation_m * direction();
    return error;
}

double rotation_sigma(const Matrix6& covariance) {
    return std::sqrt(covariance.topLeftCorner<3, 3>().trace());
}

double position_sigma(const Matrix6& covariance) {
    return std::sqrt(covariance.bottomRightCorner<3, 3>().trace());
}

double normalised_error_squared(const Vector6& error, const Matrix6& covariance) {
    const Cholesky factor = cholesky(covariance);
    if (!factor.positive_definite) return std::numeric_limits<double>::infinity();
    return lower_solve(factor.L, error).squaredNorm();
}

Matrix6 covariance_of_product(const Rigid3& T_a_b, const Matrix6& covariance_of_a_b, const Rigid3& T_b_c) {
    // q_ac turns with q_ab; t_ac = q_ab t_bc + t_ab  =>  d_ac = d_ab - [q_ab t_bc] r
    Matrix6 J = Matrix6::Identity();
    J.bottomLeftCorner<3, 3>() = -skew(to_eigen(T_a_b.q * T_b_c.t));
    return J * covariance_of_a_b * J.transpose();
}

Matrix6 covariance_in_other_axes(const Quat& q_a_c, const Matrix6& covariance) {
    // q_ab = q_ac q_cb and t_ab = q_ac t_cb + t_ac: both errors only turn.
    const Eigen::Matrix3d R = rotation_matrix(q_a_c);
    Matrix6 J = Matrix6::Zero();
    J.topLeftCorner<3, 3>() = R;
    J.bottomRightCorner<3, 3>() = R;
    return J * covariance * J.transpose();
}

}  // namespace narpa
