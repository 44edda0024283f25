/// renderer/frame/culling/tile_window.h - a tile's pixels and those around them, in rows.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "renderer/frame/g_buffer.h"

namespace narpa {

inline constexpr int kWindowBorder = 2;
inline constexpr int kWindowRow = 16;  ///< row stride, padded to the width of a vector
template <class T>
using WindowGrid = std::array<T, (kTile + 2 * kWindowBorder) * kWindowRow>;

/// (0, 0): the tile's first pixel.
constexpr std::size_t window_cell(int x, int y) noexcept {
    return static_cast<std::size_t>((y + kWindowBorder) * kWindowRow + x + kWindowBorder);
}
/// The range of cells that holds the tile's own.
inline constexpr std::size_t kFirstCell = window_cell(0, 0), kEndCell = window_cell(kTile - 1, kTile - 1) + 1;

/// Calls `act(other, place, at)` for the pixels of the image that are not of this tile, but at most `border` <=
/// kWindowBorder pixels from it: tile, place there, and cell.
template <class Do>
void each_pixel_beside(const GBuffer& g_buffer, std::uint32_t tile, int border, Do&& act) {
    const int tx = static_cast<int>(tile) % g_buffer.tiles_x(), ty = static_cast<int>(tile) / g_buffer.tiles_x();
    const auto first = [&](int k) { return k < 0 ? kTile - border : 0; };
    const auto end = [&](int k, int in_image) { return std::min(k > 0 ? border : kTile, in_image); };
    for (int row = -1; row <= 1; ++row)
        for (int column = -1; column <= 1; ++column) {
            const int x = tx + column, y = ty + row;
            if (x < 0 || y < 0 || x >= g_buffer.tiles_x() || y >= g_buffer.tiles_y()) continue;
            if (row == 0 && column == 0) continue;
            const auto other = static_cast<std::uint32_t>(y * g_buffer.tiles_x() + x);
            const int x_end = end(column, g_buffer.width() - x * kTile);
            const int y_end = end(row, g_buffer.height() - y * kTile);
            for (int py = first(row); py < y_end; ++py)
                for (int px = first(column); px < x_end; ++px)
                    act(other, place_in_tile(px, py), window_cell(px + column * kTile, py + row * kTile));
        }
}
/// The same with the tile's own pixels.
template <class Do>
void each_pixel_in_window(const GBuffer& g_buffer, std::uint32_t tile, int border, Do&& act) {
    const int x_end = std::min(kTile, g_buffer.width() - static_cast<int>(tile) % g_buffer.tiles_x() * kTile);
    const int y_end = std::min(kTile, g_buffer.height() - static_cast<int>(tile) / g_buffer.tiles_x() * kTile);
    for (int y = 0; y < y_end; ++y)
        for (int x = 0; x < x_end; ++x) act(tile, place_in_tile(x, y), window_cell(x, y));
    each_pixel_beside(g_buffer, tile, border, act);
}

}  // namespace narpa
