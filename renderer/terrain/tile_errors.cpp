#include "renderer/terrain/tile_errors.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace narpa {
namespace {

constexpr std::size_t kMax = kTileCells + 1;

/// The two triangles of each cell of a row of cells: at each column their heights are linear in v, a + v b.
struct CellRow {
    std::array<double, kMax> u{}, upper_a{}, upper_b{}, lower_a{}, lower_b{};

    CellRow(const HeightWindow& h, int stride, int top, int bottom) {
        for (int left = 0; left < h.width; left += stride) {
            const int right = std::min(left + stride, h.width);
            const double nw = h(left, top), ne = h(right, top), se = h(right, bottom), sw = h(left, bottom);
            const bool has_surface = std::isfinite(nw + ne + se + sw);
            for (int column = left; column <= right; ++column) {  // the last one is also the next cell's first
                const auto c = static_cast<std::size_t>(column);
                u[c] = static_cast<double>(column - left) / (right - left);
                upper_a[c] = has_surface ? nw + u[c] * (ne - nw) : std::nan(""), upper_b[c] = se - ne;
                lower_a[c] = has_surface ? nw + u[c] * (se - sw) : std::nan(""), lower_b[c] = sw - nw;
            }
        }
    }
    /// The largest distance in a row of posts; `differs`: one of the two surfaces has a hole where the other has
    /// none.
    double error(const double* posts, std::size_t n, double v, double& differs) const {
        double largest = 0;
        for (std::size_t c = 0; c < n; ++c) {
            const double surface = u[c] >= v ? upper_a[c] + v * upper_b[c] : lower_a[c] + v * lower_b[c];
            const double off = std::abs(surface - posts[c]);
            largest = off > largest ? off : largest;
            const double hole = surface == surface ? 0 : 1, no_post = posts[c] == posts[c] ? 0 : 1;
            differs += std::abs(hole - no_post);
        }
        return largest;
    }
};

}  // namespace

double tile_error(const HeightWindow& heights, int stride, double hole_m, double enough_m) {
    double largest = 0, differs = 0;
    for (int top = 0; top < heights.height; top += stride) {
        const int bottom = std::min(top + stride, heights.height);
        const CellRow cells(heights, stride, top, bottom);
        const int last = bottom == heights.height ? bottom : bottom - 1;
        for (int row = top; row <= last; ++row) {
            const double v = static_cast<double>(row - top) / (bottom - top);
            largest = std::max(largest, cells.error(heights.at + static_cast<std::size_t>(row) * heights.row_step,
                                                    static_cast<std::size_t>(heights.width) + 1, v, differs));
            if (differs > 0) largest = std::max(largest, hole_m * stride);
            if (largest > enough_m) return largest;
        }
    }
    return largest;
}

}  // namespace narpa
