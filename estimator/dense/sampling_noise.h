/// estimator/dense/sampling_noise.h - size of the sampling noise of frame and render, from their differences.
#pragma once

#include "estimator/dense/photometric_fit.h"

namespace narpa {

/// PhotometricImages::sampling_factor of a frame whose own sampling noise is not known: a rendered frame has noise
/// of unknown size where the render has it too (edges, textures), that of a camera has none, and low-discrepancy
/// samples have less than the render states. The factor at which the residuals of these pixels are as large as the
/// noise: maximum likelihood, each square limited to nine times its variance (P. J. Huber, Ann. Math. Stat. 35,
/// 1964, proposal 2). Pixels count by their leverage, the part that they have in the pose, as the stated variance
/// is too large beside edges. At most `most`, at least kLeastSamplingFactor.
[[nodiscard]] double sampling_factor(const PhotometricImages& images, const Exposure& exposure, double most);

/// Low-discrepancy samples: at the edges of the docking scene squared residuals are 0.38 of the stated variance.
inline constexpr double kLeastSamplingFactor = 0.25;

}  // namespace narpa
