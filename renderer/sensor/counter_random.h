/// renderer/sensor/counter_random.h - random numbers by position, not by order: any pixel's noise can be drawn
/// alone, on any thread, and is the same.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace narpa {

using Block = std::array<std::uint32_t, 4>;

/// Philox4x32-10: J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11.
constexpr Block philox(Block c, std::array<std::uint32_t, 2> key) noexcept {
    for (int round = 0; round < 10; ++round) {
        const std::uint64_t a = std::uint64_t{0xd2511f53u} * c[0], b = std::uint64_t{0xcd9e8d57u} * c[2];
        c = {static_cast<std::uint32_t>(b >> 32) ^ c[1] ^ key[0], static_cast<std::uint32_t>(b),
             static_cast<std::uint32_t>(a >> 32) ^ c[3] ^ key[1], static_cast<std::uint32_t>(a)};
        key[0] += 0x9e3779b9u;
        key[1] += 0xbb67ae85u;
    }
    return c;
}

/// What one pixel draws in one band of one frame: two independent standard normals and an even number in (0, 1).
struct PixelNoise {
    double normal_a, normal_b, uniform;
};
/// The normals by Box and Muller (1958).
inline PixelNoise pixel_noise(std::uint64_t seed, std::uint32_t frame, std::uint32_t pixel, std::uint32_t band) {
    const Block w =
        philox({pixel, frame, band, 0}, {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)});
    const auto open = [](std::uint32_t x) { return (x + 0.5) * 0x1p-32; };
    const double radius = std::sqrt(-2 * std::log(open(w[0]))), angle = 2 * std::numbers::pi * open(w[1]);
    const double uniform = (static_cast<double>((std::uint64_t{w[2]} << 32 | w[3]) >> 12) + 0.5) * 0x1p-52;
    return {radius * std::cos(angle), radius * std::sin(angle), uniform};
}

/// Means from here on take the normal approximation of `poisson`.
inline constexpr double kPoissonExactBelow = 32;

/// A Poisson count of this mean. Below kPoissonExactBelow exact, by inversion of the distribution. Above, the
/// normal with the first Cornish-Fisher term, rounded: mean, variance and skewness stay exact (the variance that
/// the term and the rounding add, 1/18 + 1/12, is taken off), the distribution functions differ by less than 1e-3.
inline double poisson(double mean, double normal, double uniform) {
    if (!(mean > 0)) return 0;
    if (mean >= kPoissonExactBelow) {
        const double x = mean + std::sqrt(mean - 5.0 / 36) * normal + (normal * normal - 1) / 6;
        return std::max(0.0, std::floor(x + 0.5));
    }
    double p = std::exp(-mean), sum = p;
    int k = 0;
    // The bound is 13 standard deviations above the largest mean: sums that rounding keeps below `uniform` end.
    for (; sum < uniform && k < 110; ++k) {
        p *= mean / (k + 1);
        sum += p;
    }
    return k;
}

}  // namespace narpa
