/// estimator/features/flow_noise.h - covariance of a corner's position by optical flow.
#pragma once

#include <Eigen/Core>

#include "estimator/features/feature_matcher.h"

namespace narpa {

/// Covariance (px^2; u, v) of a point tracked by optical flow, for independent noise of this `variance` in the
/// pixels of the image that it is tracked to: variance * (sum of g g' over the window)^-1, g the image gradients.
/// The window reaches `half_px` to each side. Zero where the sum is singular: no corner.
[[nodiscard]] Eigen::Matrix2d flow_covariance(const TonedImage& image, double variance, double u_px, double v_px,
                                              int half_px);

}  // namespace narpa
