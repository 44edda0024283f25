#include "estimator/least_squares/levenberg_marquardt.h"

#include <Eigen/Cholesky>
#include <cassert>

namespace narpa {

DampedStep damped_step(const NormalEquations& eq, double lambda, Damping damping) {
    assert(lambda >= 0);
    Matrix6 M = eq.A;
    const Vector6 D = damping == Damping::diagonal ? Vector6(eq.A.diagonal()) : Vector6(Vector6::Ones());
    M.diagonal() += lambda * D;
    const Eigen::LLT<Matrix6> factor(M);
    DampedStep step;
    if (factor.info() != Eigen::Success) return step;
    step.h = factor.solve(eq.g);
    step.predicted_reduction = step.h.dot(lambda * D.cwiseProduct(step.h) + eq.g);
    step.solved = std::isfinite(step.predicted_reduction);
    return step;
}

bool invert_information(const Matrix6& A, Matrix6& inverse) {
    // A pivot of L D L' over its diagonal entry does not depend on the row's unit.
    constexpr double kSmallestPivot = 1e-12;
    const Eigen::LLT<Matrix6> factor(A);
    if (factor.info() != Eigen::Success) return false;
    const Vector6 pivots = factor.matrixLLT().diagonal().cwiseAbs2().cwiseQuotient(A.diagonal());
    if (!(pivots.minCoeff() > kSmallestPivot)) return false;
    inverse = factor.solve(Matrix6::Identity());
    inverse = (0.5 * (inverse + inverse.transpose())).eval();
    return inverse.allFinite();
}

}  // namespace narpa
