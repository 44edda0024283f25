/// tests/support/lens_ray.h - one ray of a camera with a lens.
#pragma once

#include "renderer/camera/scene_camera.h"
#include "renderer/optics/lens.h"

namespace narpa::test {

/// The ray from a point of the aperture that is focused on image point (x, y), world axes.
[[nodiscard]] inline Ray lens_ray(const Camera& camera, const Lens& lens, const Rigid3& T_world_camera, double x,
                                  double y, const Vec3& from) {
    return {T_world_camera * from, T_world_camera.q * lens_direction(lens, camera.model->direction({x, y}), from)};
}

}  // namespace narpa::test
