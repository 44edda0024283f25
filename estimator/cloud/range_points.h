/// estimator/cloud/range_points.h - a LiDAR's sweep as measurements.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/pose.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa {

struct Lidar;

/// One return, in the LiDAR's frame: the beam as it was fired and the range that was read.
struct RangePoint {
    Vec3 origin_m{};     ///< where the beam starts
    Vec3 direction{};    ///< unit
    double range_m = 0;  ///< along the beam, > 0
    double t_s = 0;      ///< when it was fired, relative to the time of the pose

    [[nodiscard]] Vec3 position_m() const { return origin_m + range_m * direction; }
};

/// Standard deviations of a return. Seen along the normal of a surface that the beam meets at the angle i from it,
/// a point is off by sqrt((range cos i)^2 + (distance * pointing * sin i)^2): what pointing and the width of the
/// footprint do to the range grows as tan i.
struct RangeNoise {
    double range_m = 0.02;         ///< including the rounding in the packet: resolution / sqrt(12)
    double pointing_rad = 5.1e-5;  ///< of the beam's direction: an azimuth rounded to 0.01 deg
    /// Full angle of the beam. Where a surface ends within it, the range is that of the part that meets it, or a
    /// mean of two surfaces: such points are left out. 0: a line.
    double footprint_rad = 0;
};

/// Of a LiDAR's returns as its scene models them; where it models no noise, the values above.
[[nodiscard]] RangeNoise range_noise_of(const Lidar& lidar);

/// Appends a packet's decoded returns to `out`. `packet_after_ns`: time of the packet's first shot after the time
/// of the pose.
inline void append_points(std::span<const LidarPoint> packet, std::int64_t packet_after_ns,
                          std::vector<RangePoint>& out) {
    for (const LidarPoint& p : packet)
        out.push_back(
            {p.origin_m, p.direction, p.range_m, 1e-9 * static_cast<double>(packet_after_ns + p.t_offset_ns)});
}

}  // namespace narpa
