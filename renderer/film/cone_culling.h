/// renderer/film/cone_culling.h - which tiles of an image may show a body, for any camera model.
///
/// The rays of a rectangle of tiles lie in a cone about their origin (CameraModel::bounds), the parts of a body in
/// balls: where the cone and a ball's cone are apart, the rectangle does not show it. Whichever of the two is wider
/// is divided further, down to single tiles and the leaves of the box tree. Looser and slower than
/// tile_culling.cpp's projection of boxes, which needs a pinhole.
#pragma once

#include <span>

#include "renderer/camera/camera_model.h"
#include "renderer/film/body_view.h"
#include "renderer/film/tile_mask.h"
#include "renderer/geometry/box_tree.h"

namespace narpa {

class ConeCulling {
public:
    /// `lens` may be null. All outlive it.
    ConeCulling(const CameraModel& model, const Lens* lens, int tiles_x, int tiles_y) noexcept;

    /// Marks the tiles that may show a body within the leaves of a box tree, each grown by `slack_m`.
    void mark(std::span<const BoxNode> nodes, const BodyView& view, double slack_m, TileMask& mask) const noexcept;

private:
    struct Body;
    struct Ball;
    void mark(const Body& body, std::uint32_t node, const TileRect& rect, TileMask& mask) const noexcept;
    [[nodiscard]] Ball ball(const Body& body, const BoxNode& node) const noexcept;
    [[nodiscard]] DirectionCone cone(const TileRect& rect) const noexcept;

    const CameraModel& model_;
    int tiles_x_, tiles_y_;
    double lens_radius_m_ = 0;  ///< by which origins of rays differ
    double turn_rad_ = 0;       ///< by which the lens turns a ray at most
};

}  // namespace narpa
