#include "renderer/atmosphere/chapman.h"

#include <cmath>
#include <numbers>

#include "renderer/atmosphere/gauss_legendre.h"

namespace narpa {
namespace {

const Quadrature kChapmanNodes = gauss_legendre(32);

/// Column to infinity along a ray that does not descend: the integral of exp(-height) ds, lengths in scale heights.
/// Heights come from (s^2 + 2 x s cos) / (r + x), which avoids cancellation.
double rising_column(double x, double cosine) {
    // The integral stops 40 scale heights above the start; the rest is negligible.
    constexpr double kEnd = 40;
    const double end =
        kEnd * (kEnd + 2 * x) / (x * cosine + std::sqrt(x * x * cosine * cosine + kEnd * (kEnd + 2 * x)));
    double sum = 0;
    // s = end t^2: nodes are dense where the air is dense.
    for (std::size_t i = 0; i < kChapmanNodes.node.size(); ++i) {
        const double t = kChapmanNodes.node[i], s = end * t * t;
        const double gained = s * s + 2 * x * s * cosine;
        const double height = gained / (x + std::sqrt(x * x + gained));
        sum += kChapmanNodes.weight[i] * 2 * end * t * std::exp(-height);
    }
    return sum;
}

}  // namespace

double erfcx(double y) noexcept {
    if (y < 20) return std::exp(y * y) * std::erfc(y);
    // Asymptotic: the fifth term is 1e-12 of the first at 20.
    const double z = 1 / (2 * y * y);
    return (1 - z * (1 - 3 * z * (1 - 5 * z * (1 - 7 * z)))) / (y * std::sqrt(std::numbers::pi));
}

double chapman(double x, double zenith_rad) noexcept {
    const double cosine = std::cos(zenith_rad);
    if (cosine >= 0) return rising_column(x, cosine);
    const double lowest = x * std::sin(zenith_rad);
    return 2 * std::exp(x - lowest) * rising_column(lowest, 0) - rising_column(x, -cosine);
}

}  // namespace narpa
