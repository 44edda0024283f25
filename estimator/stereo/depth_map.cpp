#include "estimator/stereo/depth_map.h"

#include <algorithm>
#include <limits>

namespace narpa {

std::vector<double> depth_map(const StereoPoints& matches, int width, int height, int grid_px) {
    std::vector<double> depths(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                               std::numeric_limits<double>::quiet_NaN());
    for (const StereoPoint& p : matches.points) {
        const int left = static_cast<int>(p.left_px.x()) - grid_px / 2;
        const int top = static_cast<int>(p.left_px.y()) - grid_px / 2;
        for (int y = std::max(top, 0); y < std::min(top + grid_px, height); ++y)
            for (int x = std::max(left, 0); x < std::min(left + grid_px, width); ++x)
                depths[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                       static_cast<std::size_t>(x)] = p.point.point_m.z();
    }
    return depths;
}

}  // namespace narpa
