/// renderer/trace/concentric_disc.h - the unit square onto the unit disc, areas and neighbourhoods kept.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

namespace narpa {

/// (u, v) in [0, 1)^2 to a point of the unit disc: P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and
/// Square", J. Graphics Tools 2(3), 1997.
[[nodiscard]] inline std::array<double, 2> concentric_disc(double u, double v) noexcept {
    const double a = 2 * u - 1, b = 2 * v - 1;
    if (a == 0 && b == 0) return {0, 0};
    constexpr double kQuarterPi = std::numbers::pi / 4;
    const bool wide = std::abs(a) > std::abs(b);
    const double r = wide ? a : b, phi = wide ? kQuarterPi * (b / a) : 2 * kQuarterPi - kQuarterPi * (a / b);
    return {r * std::cos(phi), r * std::sin(phi)};
}

}  // namespace narpa
