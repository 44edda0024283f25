/// estimator/dense/pixel_sides.h - what moves over the borders of a pixel: the first two terms of its derivative.
#pragma once

#include "estimator/dense/border_points.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// While a row is exposed.
struct RowView {
    Vec3 t_camera_target{};
    ApparentMotion motion{};
    double row_s = 0;  ///< to the next row
};

/// Of the square's pixel (column, row): DN per unit of the pose's error, summed over the lines from border to
/// border (image_derivative.h). `tracer`: of the same grid as the points.
[[nodiscard]] Vector6 flow_over_borders(const FineGrid& grid, PointTracer& tracer, const BorderPoints& points,
                                        int column, int row, const RowView& view);

}  // namespace narpa
