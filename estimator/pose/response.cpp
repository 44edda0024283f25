#include "estimator/pose/response.h"

#include "estimator/pose/symmetric.h"

namespace narpa {
namespace {

/// Of 75 answers with the least response, below 0.7, the NEES was 7.4 with all of R and 6.2 with nothing taken
/// away.
constexpr double kHalfShown = 0.5;

}  // namespace

/// C^(1/2) (A' A)^-1 C^(T/2), A = C^(-1/2) R C^(1/2).
Matrix6 covariance_by_response(const Matrix6& covariance, const Matrix6& response, double most_shown) {
    const Matrix6 root = cholesky(covariance).L;
    const Matrix6 shown = lower_solve(root, Matrix6(response * root));
    const SymmetricEigen eigen = symmetric_eigen(shown.transpose() * shown);
    const double most = eigen.values.minCoeff() < kHalfShown * kHalfShown ? 1 : most_shown;
    const Vector6 squares = eigen.values.cwiseMin(most * most).cwiseMax(kLeastShown * kLeastShown);
    const Matrix6 out = root * eigen.vectors;
    return out * squares.cwiseInverse().asDiagonal() * out.transpose();
}

}  // namespace narpa
