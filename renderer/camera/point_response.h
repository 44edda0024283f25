/// renderer/camera/point_response.h - what the pixels about a point of light receive of it.
///
/// The filter of point_spread.h works on whole pixels and cannot place a point between them. Here the light of a
/// lens's image of a point is integrated over each pixel's area, for points at 1/16 px apart; in between it is
/// interpolated linearly. The transfer function is the same, up to 8 cycles a pixel (an image's: 3).
#pragma once

#include <cstddef>
#include <vector>

#include "renderer/camera/point_spread.h"
#include "renderer/image/radiance_image.h"

namespace narpa {

class PointResponse {
public:
    /// `disc_px`: diameter of the evenly lit disc that a lens out of focus makes of the point, at most 60; 0: in
    /// focus. Without either the light stays in the point's pixel, apart from points within 0.1 px of its border.
    PointResponse(const PointSpreadFunction& spread, double disc_px);

    /// The light reaches so many pixels to each side of the point's own.
    [[nodiscard]] int radius() const noexcept { return radius_; }
    /// Adds light to row y of an image so wide, for a point at (point_x, point_y): `light` is the sum over all
    /// pixels. Its position is finite.
    void add(double point_x, double point_y, const Rgb& light, int y, int width, Rgb* row) const noexcept;

    static constexpr int kSteps = 16;  ///< a pixel

private:
    /// Of a point at so many steps right of and below the left upper corner of its pixel.
    [[nodiscard]] std::size_t table(int step_x, int step_y) const noexcept {
        const auto size = static_cast<std::size_t>(2 * radius_ + 1);
        return static_cast<std::size_t>(step_y * (kSteps + 1) + step_x) * size * size;
    }

    int radius_ = 0;
    std::vector<float> weights_;  ///< the pixels about the point, row by row, for each step; each sums to 1
};

}  // namespace narpa
