/// base/concentric_disc.h - area-preserving map of the unit square onto the unit disc with low
/// distortion.
#pragma once

#include <array>
#include <cmath>

#include "base/fast_math.h"

namespace narpa {

/// (u, v) in [0, 1)^2 to a point of the unit disc: P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and
/// Square", J. Graphics Tools 2(3), 1997.
[[nodiscard]] inline std::array<double, 2> concentric_disc(double u, double v) noexcept {
    const double a = 2 * u - 1, b = 2 * v - 1;
    const bool wide = std::abs(a) > std::abs(b);
    const double r = wide ? a : b, ratio = (wide ? b : a) / (r == 0 ? 1 : r);
    const auto [sin, cos] = sincos_of_turns(0.125 * ratio);  // of the angle from the nearer axis
    return {r * (wide ? cos : sin), r * (wide ? sin : cos)};
}

}  // namespace narpa
