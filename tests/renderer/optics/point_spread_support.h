/// tests/renderer/optics/point_spread_support.h - the transfer function of a filter.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "renderer/optics/point_spread.h"

namespace narpa::test {

/// Of the filter, at (fx, fy) cycles a pixel.
inline std::complex<double> transfer_of(const SeparableFilter& filter, double fx, double fy) {
    const auto sum = [&](const std::vector<float>& weights, double f) {
        std::complex<double> s = 0;
        for (int k = -filter.radius; k <= filter.radius; ++k)
            s += static_cast<double>(weights[static_cast<std::size_t>(k + filter.radius)]) *
                 std::polar(1.0, -2 * std::numbers::pi * f * k);
        return s;
    };
    std::complex<double> total = 0;
    for (const auto& [column, row] : filter.terms) total += sum(row, fx) * sum(column, fy);
    return total;
}

/// Largest difference between the transfer of a spread and of its filter, up to half a cycle a pixel.
inline double worst_transfer_error(const PointSpreadFunction& spread) {
    const SeparableFilter filter = filter_of(spread);
    double worst = 0;
    for (double fx = spread.image ? -0.5 : 0; fx <= 0.5; fx += (fx < 0.1 ? 0.005 : 0.02))
        for (double fy = 0; fy <= 0.5; fy += (fy < 0.1 ? 0.005 : 0.02))
            worst = std::max(worst, std::abs(transfer_of(filter, fx, fy) - transfer(spread, fx, fy)));
    return worst;
}

}  // namespace narpa::test
