/// estimator/stereo/depth_map.h - matches on a grid of pixels as an image.
#pragma once

#include <vector>

#include "estimator/stereo/stereo_matcher.h"

namespace narpa {

/// Depth along the left camera's axis, m, for each pixel of the left image, row by row from the top: that of the
/// match nearest to it, as each match fills the square of `grid_px` pixels about it. NaN where there is none.
[[nodiscard]] std::vector<double> depth_map(const StereoPoints& matches, int width, int height, int grid_px);

}  // namespace narpa
