/// estimator/uncertainty/root_information.h - information about a pose from a measurement that may not observe all
/// motions.
///
/// A root W of the information matrix, for the error e of pose_estimate.h: W e is white with variance 1. A row of
/// zeros holds no information. A covariance would need infinite entries for unobserved motions, and large ones
/// beside small ones are not positive definite in double precision (1e8 beside 1e-8); a root needs none (G.
/// Bierman, Factorization Methods for Discrete Sequential Estimation, 1977).
#pragma once

#include "estimator/uncertainty/model_uncertainty.h"

namespace narpa {

/// Root information of T_a_b * T_b_c, given that of T_a_b; T_b_c is exact.
[[nodiscard]] Matrix6 root_information_of_product(const Rigid3& T_a_b, const Matrix6& root_of_a_b,
                                                  const Rigid3& T_b_c);

/// Root information with a further, independent error of the pose, shifts * n with n white and of variance 1.
[[nodiscard]] Matrix6 root_information_with(const Matrix6& root, const PoseShifts& shifts);

}  // namespace narpa
