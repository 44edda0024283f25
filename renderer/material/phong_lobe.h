/// renderer/material/phong_lobe.h - Phong's lobe, for one surface or for many lanes at once.
#pragma once

#include <algorithm>
#include <numbers>

#include "base/fast_math.h"

namespace narpa {

/// (n + 2) / (2 pi) (r.v)^n, 1/sr, without the lobe's colour; 0 where r.v <= 0. `r_v`: cosine between the mirrored
/// direction to the light and the viewer, 2 (n.l) (n.v) - l.v. No branch: loops over lanes are vectorised.
[[nodiscard]] inline float phong_lobe(double r_v, float exponent) noexcept {
    const double power = unit_power(std::min(std::max(r_v, 1e-300), 1.0), static_cast<double>(exponent));
    const float scale = (exponent + 2) * 0.5f * static_cast<float>(std::numbers::inv_pi);
    return r_v > 0 ? scale * static_cast<float>(power) : 0;
}

}  // namespace narpa
