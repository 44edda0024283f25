/// renderer/camera/dark_levels.h - what pixels without light show: read noise about the black level, digitised. All
/// of them draw from one distribution over a few DN, so they draw from a table.
///
/// A. J. Walker, "An efficient method for generating discrete random variables with general distributions", ACM
/// TOMS 3 (1977) 253: of even columns each holds two values; one random word takes a column and one of its two. The
/// table is M. D. Vose's, "A linear algorithm for generating random numbers with a given distribution", IEEE TSE 17
/// (1991) 972, in whole numbers: probabilities are those of the normal distribution to 2^-32.
#pragma once

#include <array>
#include <cstdint>

#include "renderer/geometry/lanes.h"

namespace narpa {

class DarkLevels {
public:
    static constexpr std::size_t kColumns = 256;

    /// None: pixels without light take the way of the others.
    DarkLevels() = default;
    /// Of round(black_dn + read_noise_dn * standard normal), clamped to 0 .. top_dn. None where it spreads over
    /// more than kColumns numbers, or has no noise.
    DarkLevels(double black_dn, double read_noise_dn, std::int32_t top_dn) noexcept;

    [[nodiscard]] bool any() const noexcept { return any_; }
    /// DN of an even random word.
    [[nodiscard]] std::uint32_t level(std::uint32_t word) const noexcept {
        const std::uint32_t own = word >> 24, column = columns_[own];
        return least_dn_ + ((word & 0xffffffu) < column >> 8 ? own : column & 0xffu);
    }

private:
    std::array<std::uint32_t, kColumns> columns_{};  ///< 2^24 times the part of its own value; the 8-bit other one
    std::uint32_t least_dn_ = 0;
    bool any_ = false;
};

}  // namespace narpa
