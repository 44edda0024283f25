/// renderer/scene/read_mounting.h - where a camera, a LiDAR or a light sits, read the same way for all
/// (docs/scene.md).
#pragma once

#include <vector>

#include "base/pose.h"
#include "renderer/scene/scene.h"
#include "renderer/scene/toml_reader.h"

namespace narpa {

struct Mounting {
    int mount = -1;  ///< body it rides on; -1 is the world
    Rigid3 T_mount_thing{};
};

/// The attitude that looks along `forward` (unit), upright with `right` (unit, across `forward`) at its right.
using AttitudeOf = Quat (*)(const Vec3& forward, const Vec3& right);
Quat camera_attitude(const Vec3& forward, const Vec3& right);  ///< x right, y down, z forward; lights too
Quat lidar_attitude(const Vec3& forward, const Vec3& right);   ///< x right, y forward, z up

/// `mount`, `position_m`, and `attitude_wxyz` or `look_at` with `up`.
Mounting read_mounting(TableReader& table, const std::vector<Body>& bodies, AttitudeOf attitude_of);

}  // namespace narpa
