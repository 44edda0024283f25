/// estimator/features/flow_noise.h - how far noise in a picture moves a corner that is followed to it.
#pragma once

#include <Eigen/Core>

#include "estimator/features/feature_matcher.h"

namespace narpa {

/// Covariance (px^2; u, v) of where optical flow finds a point, at `variance` of the noise of each pixel of the
/// picture that it is followed to: variance * (sum of g g' over the window)^-1, g the picture's gradients. The
/// window is `half_px` to each side. Zero where the window holds no corner: the sum is singular.
[[nodiscard]] Eigen::Matrix2d flow_covariance(const TonedImage& image, double variance, double u_px, double v_px,
                                              int half_px);

}  // namespace narpa
