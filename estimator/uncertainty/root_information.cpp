#include "estimator/uncertainty/root_information.h"

#include "estimator/least_squares/symmetric.h"

namespace narpa {

Matrix6 root_information_of_product(const Rigid3& T_a_b, const Matrix6& root_of_a_b, const Rigid3& T_b_c) {
    // The inverse of the Jacobian of covariance_of_product: d_ab = d_ac + [q_ab t_bc] r
    Matrix6 J = Matrix6::Identity();
    J.bottomLeftCorner<3, 3>() = skew(to_eigen(T_a_b.q * T_b_c.t));
    return root_of_a_b * J;
}

Matrix6 root_information_with(const Matrix6& root, const PoseShifts& shifts) {
    // W (e + J n) has the covariance S = 1 + (W J) (W J)', at least 1: its factor whitens again.
    const Matrix6 S = Matrix6::Identity() + covariance_by(root * shifts);
    return lower_solve(cholesky(S).L, root);
}

}  // namespace narpa
