/// base/constants.h - numbers used everywhere.
#pragma once

#include <limits>
#include <numbers>

namespace narpa {

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kRadPerDeg = kPi / 180, kDegPerRad = 180 / kPi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace narpa
