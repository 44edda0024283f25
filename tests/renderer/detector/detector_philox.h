/// tests/renderer/detector/detector_philox.h - the detector's random numbers, one counter at a time.
#pragma once

#include "base/counter_random.h"

namespace narpa::test {

using Block = std::array<std::uint32_t, 4>;

constexpr Block philox(Block c, std::array<std::uint32_t, 2> key) noexcept {
    for (int round = 0; round < kPhiloxRounds; ++round) {
        const std::uint64_t a = std::uint64_t{kPhiloxMultiplier[0]} * c[0],
                            b = std::uint64_t{kPhiloxMultiplier[1]} * c[2];
        c = {static_cast<std::uint32_t>(b >> 32) ^ c[1] ^ key[0], static_cast<std::uint32_t>(b),
             static_cast<std::uint32_t>(a >> 32) ^ c[3] ^ key[1], static_cast<std::uint32_t>(a)};
        key[0] += kPhiloxWeyl[0];
        key[1] += kPhiloxWeyl[1];
    }
    return c;
}

}  // namespace narpa::test
