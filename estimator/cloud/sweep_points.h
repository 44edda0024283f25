/// estimator/cloud/sweep_points.h - decoded LiDAR returns as measurements for the estimator.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa {

/// Appends a packet's returns to `out`. `packet_after_ns`: time of the packet's first shot after the time of the
/// pose.
void append_points(std::span<const LidarPoint> packet, std::int64_t packet_after_ns, std::vector<RangePoint>& out);

}  // namespace narpa
