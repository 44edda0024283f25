/// renderer/trajectory/trajectory.h - poses of bodies over time as CSV: the input of `narpa fly` and the format of
/// the truth log.
///
/// First line: kTrajectoryHeader. Then one row per body and time: seconds of simulation time, the body's name,
/// position (m, world), attitude (w, x, y, z; body to world), velocity (m/s, world), rate (rad/s, body axes).
/// Times increase for each body. Lines that start with # are comments.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/pose.h"
#include "base/result.h"

namespace narpa {

inline constexpr std::string_view kTrajectoryHeader =
    "t_s,body,x_m,y_m,z_m,qw,qx,qy,qz,vx_m_s,vy_m_s,vz_m_s,wx_rad_s,wy_rad_s,wz_rad_s";

struct TrajectoryRow {
    std::int64_t t_ns = 0;
    std::string body;
    Motion motion{};
    int line = 0;  ///< of the file that it was read from
};

/// Rows in the order of the file. TOML is a trajectory description, whose poses come from orbit and
/// attitude ephemerides and tables (trajectory_description.h). Errors name file, line and column.
Result<std::vector<TrajectoryRow>> read_trajectory(const std::string& path);

/// Attitude as given: kept bit for bit when it is a unit quaternion to rounding, normalised when it is within 1e-3
/// of one; false otherwise.
[[nodiscard]] bool accept_attitude(Quat& q) noexcept;

/// Writes one row and its line end; every number reads back bit for bit. Returns the bytes used, 0 when `out` is
/// too short (512 bytes are enough for body names up to 100). Allocates nothing.
std::size_t format_trajectory_row(std::span<char> out, std::int64_t t_ns, std::string_view body,
                                  const Motion& motion) noexcept;

}  // namespace narpa
