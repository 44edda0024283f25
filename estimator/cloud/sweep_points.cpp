#include "estimator/cloud/sweep_points.h"

#include <array>

namespace narpa {

void append_points(const vlp16::DataPacket& packet, std::int64_t packet_after_ns, std::vector<RangePoint>& out) {
    std::array<vlp16::Point, vlp16::kShots> points;
    const std::size_t count = vlp16::points(packet, points);
    for (std::size_t i = 0; i < count; ++i) {
        const vlp16::Point& p = points[i];
        out.push_back({{0, 0, vlp16::kOriginHeightM[p.laser]},
                       vlp16::direction(p.azimuth_rad, p.elevation_rad),
                       p.range_m,
                       1e-9 * static_cast<double>(packet_after_ns + p.t_offset_ns)});
    }
}

}  // namespace narpa
