#include "rehearsal/judge/statistics.h"

#include <algorithm>
#include <cmath>

namespace narpa::rehearsal {
namespace {

/// P(X >= k) of n trials with probability p each.
double at_least(std::size_t k, std::size_t n, double p) {
    if (k == 0) return 1;
    if (p <= 0 || p >= 1) return p <= 0 ? 0 : 1;
    const double trials = static_cast<double>(n);
    double sum = 0;
    for (std::size_t i = k; i <= n; ++i) {
        const double hits = static_cast<double>(i);
        sum += std::exp(std::lgamma(trials + 1) - std::lgamma(hits + 1) - std::lgamma(trials - hits + 1) +
                        hits * std::log(p) + (trials - hits) * std::log1p(-p));
    }
    return std::min(sum, 1.0);
}

/// Where a function that rises from below to above `level` within [0, 1] gets there.
template <class Function>
double crossing(Function f, double level) {
    double low = 0, high = 1;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        (f(middle) < level ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

}  // namespace

Distribution distribution(std::vector<double> values) {
    Distribution d;
    d.count = values.size();
    if (values.empty()) return d;
    std::sort(values.begin(), values.end());
    const double n = static_cast<double>(values.size());
    for (const double v : values) d.mean += v / n;
    double squares = 0;
    for (const double v : values) squares += (v - d.mean) * (v - d.mean);
    if (values.size() > 1) d.sigma = std::sqrt(squares / (n - 1));
    const auto rank = [&](double share) {
        const double at = std::ceil(share * n - 1e-9);
        return values[static_cast<std::size_t>(std::clamp(at, 1.0, n)) - 1];
    };
    d.min = values.front();
    d.p50 = rank(0.5);
    d.p90 = rank(0.9);
    d.p99 = rank(0.99);
    d.p999 = rank(0.999);
    d.max = values.back();
    return d;
}

std::pair<double, double> success_interval(std::size_t successes, std::size_t trials, double confidence) {
    const double tail = 0.5 * (1 - confidence);
    const double low =
        successes == 0 ? 0 : crossing([&](double p) { return at_least(successes, trials, p); }, tail);
    const double high =
        successes == trials ? 1 : crossing([&](double p) { return at_least(successes + 1, trials, p); }, 1 - tail);
    return {low, high};
}

}  // namespace narpa::rehearsal
