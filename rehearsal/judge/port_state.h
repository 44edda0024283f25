/// rehearsal/judge/port_state.h - where the chaser's port is beside the target's, and how it moves: what the gates
/// are about.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/pose.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// The chaser's port beside the target's at one instant.
struct PortState {
    std::int64_t t_ns = 0;  ///< simulation clock
    Vec3 position_m{};      ///< of its origin, target's port axes
    Vec3 velocity_m_s{};    ///< as the turning port axes see it
    Vec3 rotation_rad{};    ///< rotation vector off the docked attitude, chaser's port axes
    Vec3 rate_rad_s{};      ///< against the target, chaser's port axes

    [[nodiscard]] double range_m() const { return norm(position_m); }
    [[nodiscard]] double lateral_m() const;      ///< from the port's x axis
    [[nodiscard]] double closing_m_s() const;    ///< against the port's x axis
    [[nodiscard]] double lateral_m_s() const;    ///< across it
    [[nodiscard]] double pitch_yaw_rad() const;  ///< between the ports' axes, in [0, pi]
    [[nodiscard]] double roll_rad() const;       ///< about them, what is left, in [0, pi]
    [[nodiscard]] double pitch_yaw_rad_s() const;
    [[nodiscard]] double roll_rad_s() const;
};

/// From the motions of both bodies (origins of their axes), at one time.
[[nodiscard]] PortState port_state(const Scenario& scenario, std::int64_t t_ns, const Motion& target,
                                   const Motion& chaser);

/// The chaser's port in the target's, where only the relative pose is known.
[[nodiscard]] Rigid3 T_port_port(const Scenario& scenario, const Rigid3& T_chaser_target);

/// A body's commanded motion over time.
class MotionTrack {
public:
    /// False: not newer than the last one, and not taken.
    bool push(std::int64_t t_ns, const Motion& motion);
    /// Exact at the times of commands; between them a cubic through positions and velocities, the shortest arc
    /// between attitudes. Nothing before the first and after the last.
    [[nodiscard]] std::optional<Motion> at(std::int64_t t_ns) const;
    [[nodiscard]] bool empty() const { return samples_.empty(); }
    [[nodiscard]] std::int64_t newest_ns() const { return samples_.back().t_ns; }
    [[nodiscard]] std::size_t size() const { return samples_.size(); }

private:
    struct Sample {
        std::int64_t t_ns;
        Motion motion;
    };
    std::vector<Sample> samples_;
};

}  // namespace narpa::rehearsal
