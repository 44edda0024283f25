/// estimator/marks/mark_view.h - where a mark is seen from a pose.
#pragma once

#include <array>
#include <optional>

#include "estimator/pnp/pnp_points.h"
#include "renderer/scene/mark.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The image of a lamp's or reflector's disc.
struct DiscView {
    Pixel centre;    ///< of the mark's origin
    Pixel centroid;  ///< of the disc's image; perspective moves it from the origin's
    double radius_px = 0, area_px2 = 0;
};

/// Nullopt where the mark faces away from the camera (or nearly so), is behind it, or is no disc. The image point
/// may lie outside the image.
[[nodiscard]] std::optional<DiscView> disc_view(const Mark& mark, const Rigid3& T_camera_body,
                                                const CameraModel& model);

/// True if a blob finder may find it: larger than a pixel, and its centroid inside the image.
[[nodiscard]] bool is_in_view(const DiscView& view, int width, int height);

/// Corners of a tag's black square in the body's frame: top left, top right, bottom right, bottom left of its
/// image.
[[nodiscard]] std::array<Vec3, 4> tag_corners(const Mark& mark);

}  // namespace narpa
