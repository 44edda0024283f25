/// renderer/camera/camera_ray.h - from a pixel to a ray, and back.
#pragma once

#include <array>

#include "renderer/geometry/tracer.h"

namespace narpa {

/// The ray through image point (x, y), in pixels; the centre of the top-left pixel is (0, 0). Camera axes: x right,
/// y down, z forward.
[[nodiscard]] inline Ray camera_ray(const Camera& c, const Rigid3& T_world_camera, double x, double y) {
    return {T_world_camera.t, T_world_camera.q * normalized(Vec3{(x - c.cx) / c.fx, (y - c.cy) / c.fy, 1.0})};
}

/// The image point of a direction in camera axes, z > 0: the inverse of the above.
[[nodiscard]] inline std::array<double, 2> image_point(const Camera& c, const Vec3& direction_camera) {
    return {c.cx + c.fx * direction_camera.x / direction_camera.z,
            c.cy + c.fy * direction_camera.y / direction_camera.z};
}

}  // namespace narpa
