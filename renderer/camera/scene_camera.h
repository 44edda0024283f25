/// renderer/camera/scene_camera.h - rays of a scene's camera, and the same camera with another size.
#pragma once

#include "renderer/geometry/tracer.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The ray through image point (x, y), world axes.
[[nodiscard]] inline Ray camera_ray(const Camera& camera, const Rigid3& T_world_camera, double x, double y) {
    return {T_world_camera.t, T_world_camera.q * camera.model->direction({x, y})};
}

/// The same camera with the number of pixels along x and y multiplied by these factors; incomplete pixels at the
/// right and bottom edges are dropped.
[[nodiscard]] Camera scaled(const Camera& camera, double factor_x, double factor_y);
/// The same camera cropped to a part of its image.
[[nodiscard]] Camera windowed(const Camera& camera, int x, int y, int width, int height);

}  // namespace narpa
