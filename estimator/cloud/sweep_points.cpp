#include "estimator/cloud/sweep_points.h"

namespace narpa {

void append_points(std::span<const LidarPoint> packet, std::int64_t packet_after_ns, std::vector<RangePoint>& out) {
    for (const LidarPoint& p : packet)
        out.push_back(
            {p.origin_m, p.direction, p.range_m, 1e-9 * static_cast<double>(packet_after_ns + p.t_offset_ns)});
}

}  // namespace narpa
