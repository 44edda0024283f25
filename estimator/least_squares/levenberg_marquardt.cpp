#include "estimator/least_squares/levenberg_marquardt.h"

#include <cassert>

#include "estimator/least_squares/symmetric.h"

namespace narpa {

DampedStep damped_step(const NormalEquations& eq, double lambda, Damping damping) {
    assert(lambda >= 0);
    Matrix6 M = eq.A;
    const Vector6 D = damping == Damping::diagonal ? Vector6(eq.A.diagonal()) : Vector6(Vector6::Ones());
    M.diagonal() += lambda * D;
    const Cholesky factor = cholesky(M);
    DampedStep step;
    if (!factor.positive_definite) return step;
    step.h = upper_solve(factor.L, lower_solve(factor.L, eq.g));
    step.predicted_reduction = step.h.dot(lambda * D.cwiseProduct(step.h) + eq.g);
    step.solved = std::isfinite(step.predicted_reduction);
    return step;
}

bool invert_information(const Matrix6& A, Matrix6& inverse) {
    // A pivot of L D L' over its diagonal entry does not depend on the row's unit.
    constexpr double kSmallestPivot = 1e-12;
    const Cholesky factor = cholesky(A);
    if (!factor.positive_definite) return false;
    const Vector6 pivots = factor.L.diagonal().cwiseAbs2().cwiseQuotient(A.diagonal());
    if (!(pivots.minCoeff() > kSmallestPivot)) return false;
    const Matrix6 root = lower_solve(factor.L, Matrix6(Matrix6::Identity()));
    inverse = root.transpose() * root;
    return inverse.allFinite();
}

}  // namespace narpa
