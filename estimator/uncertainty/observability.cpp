#include "estimator/uncertainty/observability.h"

#include <cassert>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// Transforms (rotation * radius, translation of the centre) to (rotation, translation of the target's origin).
Matrix6 from_normalised(const PointSpread& spread) {
    Matrix6 S = Matrix6::Identity();
    S.topLeftCorner<3, 3>() /= spread.radius_m;
    S.bottomLeftCorner<3, 3>() = skew(to_eigen(spread.centre_m)) / spread.radius_m;
    return S;
}

}  // namespace

Vector6 Observability::solve(const Matrix6& hessian, const Vector6& gradient) const {
    Vector6 x = Vector6::Zero();
    for (int i = unobserved; i < 6; ++i) {
        const Vector6 m = motions.col(i);
        x += m * (m.dot(gradient) / m.dot(hessian * m));
    }
    return x;
}

Matrix6 Observability::along_motions(const Matrix6& information) const {
    assert(unobserved >= 0 && unobserved <= 6);
    Matrix6 within = motions.transpose() * information * motions;
    within.topRows(unobserved).setZero();
    within.leftCols(unobserved).setZero();
    within.topLeftCorner(unobserved, unobserved).setIdentity();
    return within;
}

Matrix6 Observability::covariance(const Matrix6& information, double factor,
                                  const std::optional<Matrix6>& of_guess) const {
    Matrix6 within = factor * ldlt_solve(along_motions(information), Matrix6(Matrix6::Identity()));
    Matrix6 unknown = kUnobservedSigma * kUnobservedSigma * Matrix6::Identity();
    if (of_guess && unobserved > 0) {
        const Matrix6 along = inverse(motions);
        unknown = along * *of_guess * along.transpose();
    }
    within.topLeftCorner(unobserved, unobserved) = unknown.topLeftCorner(unobserved, unobserved);
    const Matrix6 c = motions * within * motions.transpose();
    return 0.5 * (c + c.transpose());
}

Matrix6 Observability::root_information(const Matrix6& information, double factor) const {
    // A motion is motions * x, and so x = motions^-1 * e.
    Matrix6 root = cholesky(along_motions(information / factor)).L.transpose() * inverse(motions);
    root.topRows(unobserved).setZero();
    return root;
}

Observability observability(const Matrix6& hessian, const PointSpread& spread, double threshold) {
    assert(spread.radius_m > 0 && spread.weight > 0);
    const Matrix6 S = from_normalised(spread);
    const Matrix6 normalised = S.transpose() * hessian * S / spread.weight;
    const SymmetricEigen eigen = symmetric_eigen(0.5 * (normalised + normalised.transpose()));
    Observability o;
    o.eigenvalues = eigen.values;
    o.motions = S * eigen.vectors;
    while (o.unobserved < 6 && !(o.eigenvalues[o.unobserved] >= threshold)) ++o.unobserved;
    return o;
}

}  // namespace narpa
