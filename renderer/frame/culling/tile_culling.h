/// renderer/frame/culling/tile_culling.h - which bodies each tile of the image may show.
///
/// Rays are traced only through tiles that some body's surface may cover, and against those bodies alone: the cost
/// of a frame is proportional to the pixels that bodies cover, not to the sensor's size.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/camera_pose.h"
#include "renderer/frame/culling/body_culling.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

class TileCulling {
public:
    /// Both arguments outlive it. Allocates only here: about 80 bytes per tile, 160 if the model is no
    /// pinhole, whatever the number of bodies.
    TileCulling(const Tracer& tracer, const Camera& camera);

    /// Updates the lists for these poses. Conservative: if a ray through any point of a tile and of the lens (null:
    /// a pinhole) meets a body, the body is in the tile's list, also if it is as near as the camera, partly behind
    /// it, or around it. Of a picture taken over time: if it does so at any time of the exposure of the tile's
    /// rows. Allocates nothing.
    void update(const BodyPoses& at, const CameraPose& camera, const Lens* lens) noexcept;
    /// Lists all bodies in every tile: no culling.
    void list_all() noexcept;

    /// Bodies that rays through any of the tile's pixels may meet, in ascending order. All bodies where they are
    /// more than kMaxListed.
    [[nodiscard]] std::span<const std::uint32_t> bodies(int tile_x, int tile_y) const noexcept;
    static constexpr std::size_t kMaxListed = 16;

    [[nodiscard]] int tiles_x() const noexcept { return tiles_x_; }
    [[nodiscard]] int tiles_y() const noexcept { return tiles_y_; }

private:
    /// Marks the tiles that may show the body, which is here with its points at most `sweep_m` away.
    void mark(std::uint32_t body, const BodyView& view, double sweep_m, const Lens* lens) noexcept;
    /// The same for a body that moves in camera axes within the exposure.
    void mark_swept(std::uint32_t body, const BodyPoses& at, const CameraPose& camera, const Lens* lens) noexcept;
    void list(std::uint32_t body) noexcept;
    [[nodiscard]] std::size_t index(int tile_x, int tile_y) const noexcept {
        return static_cast<std::size_t>(tile_y) * static_cast<std::size_t>(tiles_x_) +
               static_cast<std::size_t>(tile_x);
    }

    const Tracer& tracer_;
    const Camera& camera_;
    int tiles_x_, tiles_y_;
    std::vector<std::span<const BoxNode>> boxes_;  ///< of each body's shape
    std::optional<TileCones> cones_;               ///< of models without straight lines
    TileMask mask_;                                ///< scratch, for one body at a time
    std::size_t max_listed_;
    std::vector<std::uint8_t> listed_;  ///< number of bodies in each tile's list; max_listed_ + 1: overflow
    std::vector<std::uint32_t> lists_;  ///< max_listed_ for each tile
};

}  // namespace narpa
