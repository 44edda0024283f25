/// estimator/pnp/point_observations.h - the points of a target that a method has found in one frame, with the
/// statistics of their errors, for estimators that combine frames (estimator/batch).
#pragma once

#include <vector>

#include "estimator/pnp/pnp_points.h"

namespace narpa {

/// Point i of the model is seen at seen[i]. Its error has the covariance noise[i] + scatter * beyond[i], where
/// `scatter` is common to all points and follows from their residuals.
struct PointObservations {
    std::vector<Vec3> body_m;  ///< target's axes, as a camera that exposes all rows in mid-exposure would see them
    std::vector<Pixel> seen;
    std::vector<PixelCovariance> noise, beyond;  ///< px^2
    std::vector<int> numbers;                    ///< measured: 2; 1 of a point that is known only across a line
    /// Of point i: standard deviation, px, of a shift in u and of one in v that all points have in common. Empty:
    /// none.
    std::vector<double> common_px{};
    /// Side of the windows from which the points were measured, px: two points share their errors in the proportion
    /// in which their windows overlap. 0: independent.
    double window_px = 0;
    double scatter_min = 0;
    /// Factor, at least 1, on the covariance of what is estimated, for errors that groups of points have in common.
    double inflation = 1;

    [[nodiscard]] std::size_t size() const noexcept { return body_m.size(); }
};

}  // namespace narpa
