/// scenes/generate/noise.h - repeatable randomness: the same seed gives the same scene on every machine.
#pragma once

#include <cmath>
#include <cstdint>

namespace narpa::scenes {

/// SplitMix64 finaliser (Steele, Lea, Flood 2014).
constexpr std::uint64_t hash(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/// Uniform in [0, 1), a pure function of its arguments.
constexpr double hash01(std::int64_t x, std::int64_t y, std::uint64_t seed) {
    const std::uint64_t h =
        hash(hash(static_cast<std::uint64_t>(x) + 0x51ed2701u * seed) ^ static_cast<std::uint64_t>(y));
    return static_cast<double>(h >> 11) * 0x1.0p-53;
}

/// A stream of uniform numbers.
class Random {
public:
    explicit constexpr Random(std::uint64_t seed) : state_(seed) {}
    constexpr double uniform(double low = 0, double high = 1) {
        state_ += 0x9e3779b97f4a7c15u;
        return low + (high - low) * static_cast<double>(hash(state_) >> 11) * 0x1.0p-53;
    }
    constexpr int below(int n) { return static_cast<int>(uniform() * n); }

private:
    std::uint64_t state_;
};

/// Value noise in [-1, 1] with smooth first derivatives; repeats every `period` lattice cells (0: never).
inline double value_noise(double x, double y, std::uint64_t seed, std::int64_t period = 0) {
    const double fx = std::floor(x), fy = std::floor(y);
    const auto ix = static_cast<std::int64_t>(fx), iy = static_cast<std::int64_t>(fy);
    const auto wrap = [period](std::int64_t i) { return period > 0 ? (i % period + period) % period : i; };
    const auto fade = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
    const double u = fade(x - fx), v = fade(y - fy);
    const double a = hash01(wrap(ix), wrap(iy), seed), b = hash01(wrap(ix + 1), wrap(iy), seed);
    const double c = hash01(wrap(ix), wrap(iy + 1), seed), d = hash01(wrap(ix + 1), wrap(iy + 1), seed);
    return 2 * (a + u * (b - a) + v * (c - a) + u * v * (a - b - c + d)) - 1;
}

/// Four octaves of value noise, in about [-1, 1].
inline double fractal_noise(double x, double y, std::uint64_t seed, std::int64_t period = 0) {
    double sum = 0, weight = 0.53;
    std::int64_t scale = 1;
    for (std::uint64_t octave = 0; octave < 4; ++octave, scale *= 2, weight *= 0.5)
        sum += weight * value_noise(x * static_cast<double>(scale), y * static_cast<double>(scale), seed + octave,
                                    period * scale);
    return sum;
}

/// Height at `r` radii from the middle of a crater: a bowl with a raised rim that falls off outside. All in radii.
inline double bowl_profile(double r, double depth, double rim) {
    return r < 1 ? (depth + rim) * r * r - depth : rim * std::exp(-4 * (r - 1));
}

}  // namespace narpa::scenes
