/// tests/estimator/pnp/pnp_ceres.h - the refinement of pnp_refine.h once more, by Ceres: a reference for its
/// results.
#pragma once

#include "estimator/pnp/pnp_refine.h"

namespace narpa {

/// Ceres's Levenberg-Marquardt, dense Cholesky, one residual block and one loss for each point. The covariance is
/// that of pnp_refine.h at this minimum.
[[nodiscard]] PnpFit refine_with_ceres(const PnpInput& input, const Rigid3& start, const RobustLoss& loss = {});

}  // namespace narpa
