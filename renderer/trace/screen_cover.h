/// renderer/trace/screen_cover.h - which bodies a part of the image can show at all.
///
/// Rays are sent only through tiles of the image that some body's surface may cover, and are tried against those
/// bodies alone: what a frame costs goes with the pixels that bodies cover, not with the sensor's size.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "renderer/trace/tracer.h"

namespace narpa {

inline constexpr int kCoverTile = 8;  ///< pixels a side

class ScreenCover {
public:
    /// Both outlive it. All memory is taken here.
    ScreenCover(const Tracer& tracer, const Camera& camera);

    /// For the bodies at these places. Conservative: a ray through any point of a tile, and through any point of
    /// the lens (null: a pinhole), that meets a body finds it in the tile's list, also where the body is as near as
    /// the camera, behind it in part, or around it. Allocates nothing.
    void update(const Placement& at, const Rigid3& T_world_camera, const Lens* lens) noexcept;

    /// Bodies that rays through any of the tile's pixels may meet, in ascending order; empty: nothing is there.
    [[nodiscard]] std::span<const std::uint32_t> bodies(int tile_x, int tile_y) const noexcept;

    [[nodiscard]] int tiles_x() const noexcept;
    [[nodiscard]] int tiles_y() const noexcept;

private:
};

}  // namespace narpa
