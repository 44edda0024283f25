/// estimator/search/attitude_grid.h - attitudes spread evenly over all rotations.
#pragma once

#include <vector>

#include "base/pose.h"

namespace narpa {

/// `count` attitudes on a super-Fibonacci spiral (M. Alexa, "Super-Fibonacci Spirals: Fast, Low-Discrepancy
/// Sampling of SO(3)", CVPR 2022). Neighbours are about (8 pi^2 / count)^(1/3) rad apart: 15 degrees for 4400.
[[nodiscard]] std::vector<Quat> attitude_grid(int count);

}  // namespace narpa
