/// estimator/least_squares/median.h - robust scales of residuals.
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

namespace narpa {

/// Standard deviation of a normal distribution over its median absolute deviation.
inline constexpr double kMadToSigma = 1.4826;

/// Median; for an even number of values the larger of the middle two, for none 0. Reorders the values.
template <class T>
[[nodiscard]] T upper_median(std::span<T> values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

}  // namespace narpa
