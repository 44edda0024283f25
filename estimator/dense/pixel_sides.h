/// estimator/dense/pixel_sides.h - flow over the borders of a pixel: the first two terms of its derivative.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/dense/border_points.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// The target as seen while a row is exposed.
struct RowView {
    Vec3 t_camera_target{};
    ApparentMotion motion{};
    double row_s = 0;  ///< time to the next row
};

/// Flow over the borders of a square's chosen pixels.
class TileBorderFlow {
public:
    /// All references outlive it. `tracer`: of the same grid as the points. `chosen`: as in BorderPoints::trace.
    /// Locates the contours on the lines of all these pixels in batches.
    TileBorderFlow(const FineGrid& grid, PointTracer& tracer, const BorderPoints& points, int width,
                   std::span<const std::uint8_t> chosen);
    /// Of the square's pixel (column, row): DN per unit of the pose's error, summed over the lines from border to
    /// border (image_derivative.h).
    [[nodiscard]] Vector6 flow_over_borders(int column, int row, const RowView& view) const;

private:
    [[nodiscard]] std::size_t pixel(int column, int row) const {
        return index_in(points_.square().columns, column, row);
    }

    const FineGrid& grid_;
    const BorderPoints& points_;
    std::vector<Contour> contours_;
    std::vector<RaySample> last_;     ///< sample on each contour's nearer surface, just before its end
    std::vector<std::size_t> first_;  ///< index of each pixel's first contour; the next pixel's follows its last
};

}  // namespace narpa
