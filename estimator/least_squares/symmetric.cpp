#include "estimator/least_squares/symmetric.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace narpa {

SymmetricEigen symmetric_eigen(const Matrix6& A) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(A);
    return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Cholesky cholesky(const Matrix6& A) {
    const Eigen::LLT<Matrix6> factor(A);
    return {factor.matrixL(), factor.info() == Eigen::Success};
}

Vector6 lower_solve(const Matrix6& L, const Vector6& b) {
    return L.triangularView<Eigen::Lower>().solve(b);
}

Matrix6 lower_solve(const Matrix6& L, const Matrix6& B) {
    return L.triangularView<Eigen::Lower>().solve(B);
}

Vector6 ldlt_solve(const Matrix6& A, const Vector6& b) {
    return Eigen::LDLT<Matrix6>(A).solve(b);
}

Matrix6 ldlt_solve(const Matrix6& A, const Matrix6& B) {
    return Eigen::LDLT<Matrix6>(A).solve(B);
}

Matrix6 inverse(const Matrix6& A) {
    return A.inverse();
}

}  // namespace narpa
