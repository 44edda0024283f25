/// rehearsal/judge/statistics.h - percentiles, and the confidence interval of a success rate.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace narpa::rehearsal {

/// Percentiles are values that occur: the smallest that at least so many per cent do not exceed (nearest rank).
struct Distribution {
    std::size_t count = 0;
    double mean = 0, sigma = 0;  ///< sigma: of the population from this sample; 0 for fewer than two
    double min = 0, p50 = 0, p90 = 0, p99 = 0, p999 = 0, max = 0;
};
[[nodiscard]] Distribution distribution(std::vector<double> values);

/// The share of successes that `successes` of `trials` are compatible with: the exact interval of C. Clopper and
/// E. Pearson, Biometrika 26 (1934), which holds the truth with at least `confidence`. trials > 0.
[[nodiscard]] std::pair<double, double> success_interval(std::size_t successes, std::size_t trials,
                                                         double confidence = 0.95);

}  // namespace narpa::rehearsal
