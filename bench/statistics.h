/// bench/statistics.h - means, medians, quantiles and times.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <vector>

namespace narpa {

/// The value that a fraction p of the values does not exceed; 0 for no values.
[[nodiscard]] inline double quantile(std::vector<double> values, double p) {
    if (values.empty()) return 0;
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(p * static_cast<double>(values.size() - 1) + 0.5);
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// Of an even number of values the mean of the middle two; 0 for none.
[[nodiscard]] inline double median(std::vector<double> values) {
    if (values.empty()) return 0;
    std::sort(values.begin(), values.end());
    const std::size_t n = values.size();
    return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

/// Mean and root mean square of the values added; 0 for none.
class Mean {
public:
    void add(double value) { ++n_, sum_ += value, squares_ += value * value; }
    [[nodiscard]] int count() const noexcept { return n_; }
    [[nodiscard]] double mean() const { return sum_ / std::max(1, n_); }
    [[nodiscard]] double rms() const { return std::sqrt(squares_ / std::max(1, n_)); }

private:
    int n_ = 0;
    double sum_ = 0, squares_ = 0;
};

/// CPU time of a clock: CLOCK_THREAD_CPUTIME_ID of the calling thread, CLOCK_PROCESS_CPUTIME_ID of all threads.
/// Other load on the machine does not count.
[[nodiscard]] inline double cpu_s(clockid_t clock) {
    std::timespec t{};
    clock_gettime(clock, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace narpa
