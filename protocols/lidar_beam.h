/// protocols/lidar_beam.h - one shot of a LiDAR as a CAN message: what velocimeters and altimeters report.
#pragma once

#include <cstdint>
#include <limits>

namespace narpa {

struct LidarBeamReport {
    std::uint8_t counter = 0;  ///< +1 with every report of any LiDAR, wraps
    std::uint8_t lidar = 0;    ///< index of the LiDAR in the scene
    std::uint16_t beam = 0;
    std::int64_t t_ns = 0;  ///< simulation clock: when it fired
    /// Range and velocity along the beam (receding is positive), in the instrument's steps; NaN: no echo, or not
    /// measured.
    double range_m = std::numeric_limits<double>::quiet_NaN();
    double velocity_m_s = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace narpa
