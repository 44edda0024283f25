#include "estimator/pose/observability.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace narpa {
namespace {

/// Takes (rotation * radius, translation of the centre) to (rotation, translation of the target's origin).
Matrix6 from_normalised(const PointSpread& spread) {
    Matrix6 S = Matrix6::Identity();
    S.topLeftCorner<3, 3>() /= spread.radius_m;
    S.bottomLeftCorner<3, 3>() = skew(to_eigen(spread.centre_m)) / spread.radius_m;
    return S;
}

/// The part that the columns of `basis` span: basis (basis' A basis)^-1 basis', of columns from `first` on.
Matrix6 restricted_inverse(const Matrix6& A, const Matrix6& basis, int first) {
    Matrix6 within = basis.transpose() * A * basis;
    within.topRows(first).setZero();
    within.leftCols(first).setZero();
    within.topLeftCorner(first, first).setIdentity();
    Matrix6 inverse = within.ldlt().solve(Matrix6::Identity());
    inverse.topLeftCorner(first, first).setZero();
    return basis * inverse * basis.transpose();
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

Matrix6 Observability::covariance(const Matrix6& information, double factor) const {
    Matrix6 c = factor * restricted_inverse(information, motions, unobserved);
    for (int i = 0; i < unobserved; ++i)
        c += kUnobservedSigma * kUnobservedSigma * motions.col(i) * motions.col(i).transpose();
    return 0.5 * (c + c.transpose());
}

Matrix6 Observability::root_information(const Matrix6& information, double factor) const {
    // A motion is motions * x, and so x = motions^-1 * e.
    Matrix6 within = motions.transpose() * information * motions / factor;
    within.topRows(unobserved).setZero();
    within.leftCols(unobserved).setZero();
    within.topLeftCorner(unobserved, unobserved).setIdentity();
    Matrix6 root = within.llt().matrixU() * motions.inverse();
    root.topRows(unobserved).setZero();
    return root;
}

Observability observability(const Matrix6& hessian, const PointSpread& spread, double threshold) {
    const Matrix6 S = from_normalised(spread);
    const Matrix6 normalised = S.transpose() * hessian * S / spread.weight;
    const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(0.5 * (normalised + normalised.transpose()));
    Observability o;
    o.eigenvalues = eigen.eigenvalues();
    o.motions = S * eigen.eigenvectors();
    while (o.unobserved < 6 && !(o.eigenvalues[o.unobserved] >= threshold)) ++o.unobserved;
    return o;
}

}  // namespace narpa
