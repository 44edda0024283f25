/// estimator/features/flow_noise.h - how far noise in a picture moves a corner that is followed to it.
#pragma once

#include <Eigen/Core>

#include "estimator/features/feature_matcher.h"

namespace narpa {

/// Variance of each pixel of a toned picture, in its own steps: what `toned` makes of the sensor's noise, and
/// rounding.
[[nodiscard]] std::vector<float> toned_variance(const TonedImage& image, const SensorModel& sensor, double top_dn);

/// Covariance (px^2; u, v) of where optical flow finds a point: noise propagated through the least squares of the
/// window, G^-1 (sum of s^2 g g') G^-1 with the gradients g of the picture that is followed and G = sum of g g'.
/// The window is `half_px` to each side. Zero where the window holds no corner: G is singular.
[[nodiscard]] Eigen::Matrix2d flow_covariance(const TonedImage& image, const std::vector<float>& variance,
                                              double u_px, double v_px, int half_px);

}  // namespace narpa
