/// renderer/scene/mounting.h - the keys that cameras, LiDARs and lights share: their name, and where they sit.
#pragma once

#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "renderer/keys/toml_reader.h"
#include "renderer/scene/scene.h"

namespace narpa {

inline constexpr TableKey kNameRow{"name", rows::text(), "a text"}, kMountRow{"mount", rows::text()},
    kPositionRow{"position_m", rows::vec3()}, kAttitudeRow{"attitude_wxyz", rows::attitude()},
    kLookAtRow{"look_at", rows::vec3()}, kUpRow{"up", rows::vec3()};
/// All of these rows: a part of the keys of sensors.
extern const TableKeys kMountingKeys;

struct Mounting {
    int mount = -1;  ///< body that carries it; -1 is the world
    Rigid3 T_mount_sensor{};
};

/// A sensor's attitude from its boresight `forward` and its `right` axis: unit vectors, orthogonal, parent axes.
using AttitudeOf = Quat (*)(const Vec3& forward, const Vec3& right);
Quat camera_attitude(const Vec3& forward, const Vec3& right);  ///< x right, y down, z forward; lights too
Quat lidar_attitude(const Vec3& forward, const Vec3& right);   ///< x right, y forward, z up

/// Where a camera, a LiDAR or a light sits: `mount`, `position_m`, and `attitude_wxyz` or `look_at` with `up`.
Mounting read_mounting(TableReader& table, const std::vector<Body>& bodies, AttitudeOf attitude_of);

/// Names that tables of one kind have.
using TakenNames = std::unordered_set<std::string>;
/// Whether it is 1 to 64 of letters, digits, '_', '-', '.'.
[[nodiscard]] bool is_name(std::string_view name);
/// `name`, which no other table of its kind has.
std::string read_name(TableReader& table, TakenNames& taken);

}  // namespace narpa
