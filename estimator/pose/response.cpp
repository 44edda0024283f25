#include "estimator/pose/response.h"

#include "estimator/pose/symmetric.h"

namespace narpa {

/// C^(1/2) (A' A)^-1 C^(T/2), A = C^(-1/2) R C^(1/2).
Matrix6 covariance_by_response(const Matrix6& covariance, const Matrix6& response, double most_shown) {
    const Matrix6 root = cholesky(covariance).L;
    const Matrix6 shown = lower_solve(root, Matrix6(response * root));
    const SymmetricEigen eigen = symmetric_eigen(shown.transpose() * shown);
    const Vector6 squares = eigen.values.cwiseMin(most_shown * most_shown).cwiseMax(kLeastShown * kLeastShown);
    const Matrix6 out = root * eigen.vectors;
    return out * squares.cwiseInverse().asDiagonal() * out.transpose();
}

}  // namespace narpa
