#include "estimator/uncertainty/response.h"

#include <cassert>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// If a response is below this, no variance is reduced. An answer with the response 0.44 along its weakest motion
/// had NEES 53, and 42 without any reduction. For the 32 of 620 answers below this the mean NEES fell from 5.4 to
/// 4.5.
constexpr double kResponseUnreliable = 0.5;

}  // namespace

/// C^(1/2) (A' A)^-1 C^(T/2), A = C^(-1/2) R C^(1/2).
Matrix6 covariance_by_response(const Matrix6& covariance, const Matrix6& response, double response_max) {
    assert(response_max >= 1);
    const Matrix6 root = cholesky(covariance).L;
    const Matrix6 shown = lower_solve(root, Matrix6(response * root));
    const SymmetricEigen eigen = symmetric_eigen(shown.transpose() * shown);
    const double most = eigen.values.minCoeff() < kResponseUnreliable * kResponseUnreliable ? 1 : response_max;
    const Vector6 squares = eigen.values.cwiseMin(most * most).cwiseMax(kResponseMin * kResponseMin);
    const Matrix6 out = root * eigen.vectors;
    return out * squares.cwiseInverse().asDiagonal() * out.transpose();
}

}  // namespace narpa
