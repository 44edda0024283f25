/// renderer/frame/culling/tile_mask.h - rectangles and sets of an image's tiles.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <vector>

namespace narpa {

inline constexpr int kTileSize = 8;  ///< pixels per side

/// A rectangle of tiles, bounds inclusive.
struct TileRect {
    int x_first, y_first, x_last, y_last;
};

/// Splits a rectangle of at least two tiles across its longer side.
inline std::array<TileRect, 2> halves(const TileRect& r) noexcept {
    const int columns = r.x_last - r.x_first + 1, rows = r.y_last - r.y_first + 1;
    TileRect low = r, high = r;
    if (columns >= rows)
        low.x_last = r.x_first + columns / 2 - 1, high.x_first = low.x_last + 1;
    else
        low.y_last = r.y_first + rows / 2 - 1, high.y_first = low.y_last + 1;
    return {low, high};
}

/// A set of tiles of an image, one bit per tile.
class TileMask {
public:
    TileMask(int tiles_x, int tiles_y)
        : tiles_x_(tiles_x),
          tiles_y_(tiles_y),
          words_per_row_((static_cast<std::size_t>(tiles_x) + 63) / 64),
          words_(words_per_row_ * static_cast<std::size_t>(tiles_y)),
          row_first_(tiles_y) {}

    /// The whole image.
    [[nodiscard]] TileRect all() const noexcept { return {0, 0, tiles_x_ - 1, tiles_y_ - 1}; }
    void mark(const TileRect& r) noexcept {
        assert(r.x_first >= 0 && r.x_last < tiles_x_ && r.y_first >= 0 && r.y_last < tiles_y_);
        row_first_ = std::min(row_first_, r.y_first), row_last_ = std::max(row_last_, r.y_last);
        for_each_word(r, [](std::uint64_t& word, std::uint64_t bits) {
            word |= bits;
            return true;
        });
    }
    [[nodiscard]] bool all_marked(const TileRect& r) noexcept {
        return for_each_word(r, [](std::uint64_t& word, std::uint64_t bits) { return (word & bits) == bits; });
    }

    /// Calls f(column, row) for each marked tile, row by row, and clears it.
    template <class F>
    void drain(const F& f) noexcept {
        for (int row = row_first_; row <= row_last_; ++row)
            for (std::size_t w = 0; w < words_per_row_; ++w) {
                std::uint64_t& word = words_[static_cast<std::size_t>(row) * words_per_row_ + w];
                for (; word != 0; word &= word - 1) f(static_cast<int>(64 * w) + std::countr_zero(word), row);
            }
        row_first_ = tiles_y_, row_last_ = -1;
    }

private:
    /// Calls f(word, its bits within the rectangle) until it returns false.
    template <class F>
    bool for_each_word(const TileRect& r, const F& f) noexcept {
        const auto first = static_cast<unsigned>(r.x_first), last = static_cast<unsigned>(r.x_last);
        for (int row = r.y_first; row <= r.y_last; ++row)
            for (std::size_t w = first / 64; w <= last / 64; ++w) {
                std::uint64_t bits = ~0ull;
                if (w == first / 64) bits &= ~0ull << first % 64;
                if (w == last / 64) bits &= ~0ull >> (63 - last % 64);
                if (!f(words_[static_cast<std::size_t>(row) * words_per_row_ + w], bits)) return false;
            }
        return true;
    }

    int tiles_x_, tiles_y_;
    std::size_t words_per_row_;
    std::vector<std::uint64_t> words_;
    int row_first_, row_last_ = -1;  ///< range of rows with marked tiles
};

}  // namespace narpa
