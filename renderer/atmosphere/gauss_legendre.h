/// renderer/atmosphere/gauss_legendre.h - nodes and weights of Gauss and Legendre's quadrature.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

namespace narpa {

struct Quadrature {
    std::vector<double> node, weight;  ///< in [0, 1]; the weights add up to 1
};

/// Exact for polynomials of degree 2 n - 1. Newton's iteration on the Legendre polynomial.
[[nodiscard]] inline Quadrature gauss_legendre(std::size_t n) {
    Quadrature q{std::vector<double>(n), std::vector<double>(n)};
    const auto count = static_cast<double>(n);
    for (std::size_t i = 0; i < n; ++i) {
        double x = std::cos(std::numbers::pi * (static_cast<double>(i) + 0.75) / (count + 0.5)), slope = 1;
        for (int step = 0; step < 100; ++step) {
            double p = 1, before = 0;
            for (std::size_t k = 1; k <= n; ++k) {
                const auto j = static_cast<double>(k);
                const double next = ((2 * j - 1) * x * p - (j - 1) * before) / j;
                before = p, p = next;
            }
            slope = count * (x * p - before) / (x * x - 1);
            const double change = p / slope;
            x -= change;
            if (std::abs(change) < 1e-15) break;
        }
        q.node[n - 1 - i] = 0.5 * (1 + x);
        q.weight[n - 1 - i] = 1 / ((1 - x * x) * slope * slope);
    }
    return q;
}

}  // namespace narpa
