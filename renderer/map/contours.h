/// renderer/map/contours.h - contour lines of a field of numbers on the pixels of an image, by marching squares.
///
/// A cell is the square between the centres of four neighbouring pixels. Lines cross its sides where linear
/// interpolation along the side gives the level: off by f'' / (8 f') px at most, with the derivatives of the field
/// along the side per px. Where two corners that face each other are above the level and two below, the level of
/// the saddle of the bilinear interpolant decides which are joined (Nielson and Hamann, "The asymptotic decider",
/// IEEE Visualization 1991).
#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "base/result.h"
#include "renderer/projection/camera_model.h"

namespace narpa {

/// Row-major, height x width; NaN where there is no value.
struct ScalarField {
    int width = 0, height = 0;
    std::vector<double> values;
};

/// Along the line, in an image with y down, higher values lie to the left.
struct ContourLine {
    double level = 0;
    bool closed = false;             ///< the last point is the first again
    std::vector<ImagePoint> points;  ///< px; two or more, neighbours differ
};

/// Whether the field is continuous between two pixels, given by their places in the field: the second is to the
/// right of the first or below it. Called once at most for each pair, for cells that lines cross.
using IsContinuous = std::function<bool(std::size_t, std::size_t)>;

inline constexpr int kMaxContourLevels = 1000;
/// Values at most this far below a level count as on it: three times the error of a range (tracer.h), so that noise
/// on a flat surface at a level gives no lines.
inline constexpr double kLevelTolerance = 1e-6;

/// The multiples of `interval` from the lowest to the highest value. Errors: an interval that is not above 0; more
/// than kMaxContourLevels.
[[nodiscard]] Result<std::vector<double>> contour_levels(double lowest, double highest, double interval);

/// The lines of all `levels`, which must ascend. Lines end at cells that have a corner without a value or a side
/// that is not continuous, and at the border of the image.
[[nodiscard]] std::vector<ContourLine> contour_lines(const ScalarField& field, std::span<const double> levels,
                                                     const IsContinuous& is_continuous);

}  // namespace narpa
