/// estimator/pose/root_information.h - what a measurement knows of a pose, where it does not know all of it.
///
/// A root W of the information, for the error e of pose_estimate.h: W e is white and of variance 1. A row of zeros
/// knows nothing. A covariance would need infinite entries there, and large ones beside small ones are not positive
/// definite in double precision (1e8 beside 1e-8); a root has none (G. Bierman, Factorization Methods for Discrete
/// Sequential Estimation, 1977).
#pragma once

#include "estimator/pose/model_uncertainty.h"

namespace narpa {

/// Of T_a_b * T_b_c, given that of T_a_b; T_b_c is exact.
[[nodiscard]] Matrix6 root_information_of_product(const Rigid3& T_a_b, const Matrix6& root_of_a_b,
                                                  const Rigid3& T_b_c);

/// After a further, independent error of the pose, shifts * n with n white and of variance 1.
[[nodiscard]] Matrix6 root_information_with(const Matrix6& root, const PoseShifts& shifts);

}  // namespace narpa
