/// renderer/terrain/tile_errors.h - the error of a tile with a subset of the posts against the surface through all
/// of them.
#pragma once

#include <cstddef>
#include <limits>

namespace narpa {

inline constexpr int kTileCells = 64;
inline constexpr int kTileLevels = 7;  ///< strides 1, 2 ... 64

/// A window of heights: `at[row * row_step + column]`, `width` and `height` cells (one post more).
struct HeightWindow {
    const double* at = nullptr;
    std::size_t row_step = 0;
    int width = 0, height = 0;

    [[nodiscard]] double operator()(int column, int row) const {
        return at[static_cast<std::size_t>(row) * row_step + static_cast<std::size_t>(column)];
    }
};

/// The largest vertical distance, at posts, of the triangles of every `stride`-th post from the posts, metres.
/// Where one of the two surfaces has a hole and the other none, `hole_m` times the stride at least: the width of
/// what is lost or filled. An error above `enough_m` need not be exact.
[[nodiscard]] double tile_error(const HeightWindow& heights, int stride, double hole_m,
                                double enough_m = std::numeric_limits<double>::infinity());

}  // namespace narpa
