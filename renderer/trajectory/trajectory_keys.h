/// renderer/trajectory/trajectory_keys.h - what a trajectory description says, before the files that it names
/// are read.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "renderer/trajectory/sampled_course.h"
#include "renderer/trajectory/state_table.h"

namespace narpa {

struct DescribedBody {
    std::string name;
    int line = 0;
    std::string oem{}, aem{};  ///< files; empty: none
    std::optional<StateTable> table{};
    bool at_centre = false;  ///< of the inertial frame
    Vec3 position_m{};       ///< world, of a body at rest that has no other position
    Quat q_world_body{};     ///< of a body with no other attitude
    std::optional<Interpolation> of_position{}, of_attitude{};
};

struct TrajectoryDescription {
    enum class Axes : std::uint8_t { icrf, lvlh };

    std::int64_t epoch_ns = 0;  ///< TAI since 2000 at simulation time 0
    double step_s = 1;
    std::optional<double> from_s{}, until_s{};
    std::string origin{};  ///< OEM of the world's origin; empty: the centre of the inertial frame
    std::optional<Interpolation> of_origin{};
    Axes axes{};
    Quat q_axes_world{};  ///< the world's axes against these
    std::vector<DescribedBody> bodies{};
};

Result<TrajectoryDescription> read_description_of_trajectory(const std::string& path);

}  // namespace narpa
