/// renderer/optics/point_response.h - the light that the pixels around a point source receive.
///
/// The filter of point_spread.h works on whole pixels and cannot place a point between them. Here the lens's image
/// of a point is integrated over each pixel's area, for point positions 1/16 px apart, with linear interpolation
/// between them. The transfer function is the same, up to 8 cycles per pixel (for a point spread given as an image:
/// 3).
#pragma once

#include <cstddef>
#include <vector>

#include "base/radiance_image.h"
#include "renderer/optics/point_spread.h"

namespace narpa {

class PointResponse {
public:
    /// `disc_px`: diameter of the uniform disc that a defocused lens makes of the point, at most 60; 0: in focus.
    /// With neither blur nor disc the light stays in the point's pixel, except for points within 0.1 px of its
    /// border.
    PointResponse(const PointSpreadFunction& spread, double disc_px);

    /// Number of pixels on each side of the point's own that receive light.
    [[nodiscard]] int radius() const noexcept { return radius_; }
    /// Adds light to row y of an image of this width, for a point at (point_x, point_y), which must be finite.
    /// `light` is the sum over all pixels.
    void add(double point_x, double point_y, const Rgb& light, int y, int width, Rgb* row) const noexcept;

    static constexpr int kSteps = 16;  ///< per pixel

private:
    /// Index of the table for a point this many steps right of and below the top left corner of its pixel.
    [[nodiscard]] std::size_t table(int step_x, int step_y) const noexcept {
        const auto size = static_cast<std::size_t>(2 * radius_ + 1);
        return static_cast<std::size_t>(step_y * (kSteps + 1) + step_x) * size * size;
    }

    int radius_ = 0;
    std::vector<float> weights_;  ///< for each step, the pixels around the point, row-major; each table sums to 1
};

}  // namespace narpa
