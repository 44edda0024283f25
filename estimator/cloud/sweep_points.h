/// estimator/cloud/sweep_points.h - a VLP-16's packets as the points that the estimator takes.
#pragma once

#include <cstdint>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "protocols/lidar/vlp16.h"

namespace narpa {

/// Adds a packet's returns, as its reader has them: ranges in steps of 2 mm along beams whose azimuths rest on
/// hundredths of a degree. `packet_after_ns`: its first shot after the time that the pose is asked for.
void append_points(const vlp16::DataPacket& packet, std::int64_t packet_after_ns, std::vector<RangePoint>& out);

}  // namespace narpa
