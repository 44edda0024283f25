/// estimator/pose/pnp_bound.h - how well a pose can be known from points at all.
#pragma once

#include "base/result.h"
#include "estimator/pose/pnp_points.h"

namespace narpa {

/// The Cramer-Rao bound of a pose seen through these points: the inverse of F = sum J' C^-1 J with
/// J = dpi/db [-[R a]x | I], a covariance as in pose_estimate.h. Of `input` the pixels are not read. Errors: what
/// check() finds, a point behind the camera, or a direction that the points leave undetermined.
[[nodiscard]] Result<Matrix6> pnp_bound(const PnpInput& input, const Rigid3& T_camera_body);

}  // namespace narpa
