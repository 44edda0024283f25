/// rehearsal/dynamics/random_streams.h - random numbers of a run: an engine for each purpose, so that draws for one
/// do not shift the others.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "base/constants.h"
#include "base/vec3.h"

namespace narpa::rehearsal {

enum class Stream : std::uint32_t { start = 1, misalignment, pulses, attitude_sensor };

[[nodiscard]] inline std::mt19937_64 engine(std::uint64_t seed, Stream stream) {
    std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                           static_cast<std::uint32_t>(stream)};
    return std::mt19937_64(sequence);
}

/// Three draws of unit variance: x, y, z.
[[nodiscard]] inline Vec3 draw_normal(std::mt19937_64& from) {
    std::normal_distribution<double> normal;
    Vec3 v;
    for (int i = 0; i < 3; ++i) v[i] = normal(from);
    return v;
}

/// Of the scenario's seconds; infinity stays the end of time.
[[nodiscard]] inline std::int64_t to_ns(double t_s) {
    constexpr double kEnd = 9.2e18;
    return t_s * 1e9 < kEnd ? std::llround(t_s * 1e9) : std::numeric_limits<std::int64_t>::max();
}

}  // namespace narpa::rehearsal
