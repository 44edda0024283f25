/// estimator/least_squares/symmetric.h - decompositions of 6 x 6 matrices, mostly symmetric ones.
///
/// Wrappers of Eigen's decompositions, compiled once: each instantiation takes the compiler seconds.
#pragma once

#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// Eigenvalues of a symmetric matrix, of which the lower triangle is read.
struct SymmetricEigen {
    Vector6 values;   ///< ascending
    Matrix6 vectors;  ///< columns, of length 1
};
[[nodiscard]] SymmetricEigen symmetric_eigen(const Matrix6& A);

/// A = L L', A symmetric: its lower triangle is read.
struct Cholesky {
    Matrix6 L;                       ///< zero above the diagonal; meaningless unless positive_definite
    bool positive_definite = false;  ///< A, within rounding
};
[[nodiscard]] Cholesky cholesky(const Matrix6& A);
/// L^-1 b with a lower triangular L.
[[nodiscard]] Vector6 lower_solve(const Matrix6& L, const Vector6& b);
[[nodiscard]] Matrix6 lower_solve(const Matrix6& L, const Matrix6& B);

/// A^-1 b by L D L' with pivots: A is symmetric and positive or negative semidefinite, and its lower triangle is
/// read.
[[nodiscard]] Vector6 ldlt_solve(const Matrix6& A, const Vector6& b);
[[nodiscard]] Matrix6 ldlt_solve(const Matrix6& A, const Matrix6& B);

/// Of any matrix, by LU with partial pivoting; not finite where it is singular.
[[nodiscard]] Matrix6 inverse(const Matrix6& A);

}  // namespace narpa
