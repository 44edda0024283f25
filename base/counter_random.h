/// base/counter_random.h - a counter-based random number generator: a pixel's noise depends on its index
/// alone, not on the order or the thread in which pixels are processed.
#pragma once

#include <array>
#include <cstdint>

#include "base/lanes.h"

namespace narpa {

/// Philox4x32-10: J. Salmon, M. Moraes, R. Dror, D. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11.
inline constexpr int kPhiloxRounds = 10;
inline constexpr std::array<std::uint32_t, 2> kPhiloxMultiplier{0xd2511f53u, 0xcd9e8d57u};
inline constexpr std::array<std::uint32_t, 2> kPhiloxWeyl{0x9e3779b9u, 0xbb67ae85u};

/// The keys of all rounds, for batches of kLanes counters. The multipliers are data because GCC turns a
/// multiplication by a known constant into a dozen shifts and additions.
struct PhiloxSchedule {
    std::array<std::uint64_t, 2> multiplier{kPhiloxMultiplier[0], kPhiloxMultiplier[1]};
    std::array<std::array<std::uint64_t, 2>, kPhiloxRounds> key;

    explicit PhiloxSchedule(std::uint64_t seed) noexcept {
        auto k0 = static_cast<std::uint32_t>(seed), k1 = static_cast<std::uint32_t>(seed >> 32);
        for (auto& of_round : key) {
            of_round = {k0, k1};
            k0 += kPhiloxWeyl[0];
            k1 += kPhiloxWeyl[1];
        }
    }
};

struct alignas(64) RandomLanes {
    Lanes<std::uint32_t> w0, w1, w2, w3;
};

/// Blocks of the counters {first + lane, c1, c2, 0}. Words are kept in 64 bits whose upper half is undefined:
/// products use the lower half.
inline RandomLanes philox(const PhiloxSchedule& schedule, std::uint32_t first, std::uint32_t c1,
                          std::uint32_t c2) noexcept {
    constexpr std::uint64_t low = 0xffffffffu;
    const auto [m0, m1] = schedule.multiplier;
    RandomLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        std::uint64_t w0 = first + static_cast<std::uint32_t>(i), w1 = c1, w2 = c2, w3 = 0;
#pragma GCC unroll 10
        for (std::size_t round = 0; round < kPhiloxRounds; ++round) {
            const std::uint64_t a = m0 * (w0 & low), b = m1 * (w2 & low);
            w0 = b >> 32 ^ w1 ^ schedule.key[round][0];
            w2 = a >> 32 ^ w3 ^ schedule.key[round][1];
            w1 = b;
            w3 = a;
        }
        out.w0[i] = static_cast<std::uint32_t>(w0);
        out.w1[i] = static_cast<std::uint32_t>(w1);
        out.w2[i] = static_cast<std::uint32_t>(w2);
        out.w3[i] = static_cast<std::uint32_t>(w3);
    }
    return out;
}

}  // namespace narpa
