/// renderer/film/body_view.h - a body in the camera's frame, and the camera in the body's.
#pragma once

#include <array>

#include "base/pose.h"

namespace narpa {

/// Differences first, rotations then: positions may be 4e8 m from the world's origin.
struct BodyView {
    Vec3 camera_body;               ///< place of the camera
    std::array<Vec3, 3> axes;       ///< the body's, in the camera's frame
    std::array<Vec3, 3> axes_body;  ///< the camera's, in the body's frame
    Vec3 centre_camera;             ///< the body's origin
    double rounding_m;              ///< bound of what rounding moves a ray by

    BodyView(const Rigid3& T_world_body, const Rigid3& T_world_camera) {
        const Vec3 apart = T_world_body.t - T_world_camera.t;
        const Quat q_camera_body = conjugate(T_world_camera.q) * T_world_body.q;
        camera_body = conjugate(T_world_body.q) * -apart;
        centre_camera = conjugate(T_world_camera.q) * apart;
        axes = columns(q_camera_body);
        axes_body = columns(conjugate(q_camera_body));
        rounding_m = 0x1p-49 * (norm(T_world_body.t) + norm(T_world_camera.t) + norm(apart)) + 1e-12;  // above 0
    }
};

}  // namespace narpa
