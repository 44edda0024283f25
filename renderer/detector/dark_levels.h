/// renderer/detector/dark_levels.h - digital numbers of pixels without light: read noise about the black level,
/// drawn from a table.
///
/// Alias method: A. J. Walker, "An efficient method for generating discrete random variables with general
/// distributions", ACM TOMS 3 (1977) 253. Each column has the same probability and holds two values; one random
/// word chooses the column and the value. The table is built as by M. D. Vose, "A linear algorithm for generating
/// random numbers with a given distribution", IEEE TSE 17 (1991) 972, in integers: probabilities are exact to
/// 2^-32.
#pragma once

#include <array>
#include <cstdint>

#include "base/lanes.h"

namespace narpa {

class DarkLevels {
public:
    static constexpr std::size_t kColumns = 256;

    /// No table: dark pixels are digitised like the others.
    DarkLevels() = default;
    /// Distribution of round(black_dn + read_noise_dn * standard normal), clamped to 0 .. top_dn. No table where
    /// that takes more than kColumns values, or without noise.
    DarkLevels(double black_dn, double read_noise_dn, std::int32_t top_dn) noexcept;

    [[nodiscard]] bool any() const noexcept { return any_; }
    /// DN for a uniform random word.
    [[nodiscard]] std::uint32_t level(std::uint32_t word) const noexcept {
        const std::uint32_t own = word >> 24, column = columns_[own];
        return min_dn_ + ((word & 0xffffffu) < column >> 8 ? own : column & 0xffu);
    }

private:
    std::array<std::uint32_t, kColumns> columns_{};  ///< threshold * 2^24 for its own value; 8 bits: the alias
    std::uint32_t min_dn_ = 0;
    bool any_ = false;
};

}  // namespace narpa
