/// emulator/replay/image_compare.h - how far a picture is from a better one of the same view, in the terms of those
/// who measure in pictures: light, structure, and places.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "renderer/film/camera_image.h"

namespace narpa {

/// Signed distances, px.
struct ShiftStatistics {
    std::size_t count = 0;
    double mean_px = 0, rms_px = 0, p99_px = 0;  ///< the last in magnitude: 99 of 100 are smaller
};

struct BodyShift {
    int body = 0;
    double x_px = 0, y_px = 0;  ///< of the centre of its light, from the reference to the picture
};

struct ImageDifference {
    double rmse = 0;                ///< of the mean band, W m^-2 sr^-1
    double bias = 0;                ///< mean of picture - reference, W m^-2 sr^-1
    double full_scale = 0;          ///< radiance that the two above are measured against
    double ssim = 1;                ///< mean structural similarity: 1 is the same
    ShiftStatistics edges;          ///< along the reference's gradient, at each pixel of an edge
    std::vector<BodyShift> bodies;  ///< those that can be seen and measured
};

/// Compares a picture with a reference of the same size.
///
/// Structural similarity as Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, "Image quality assessment: from error
/// visibility to structural similarity", IEEE Trans. Image Processing 13(4), 2004: Gaussian window of 1.5 px,
/// K1 = 0.01, K2 = 0.03, range `full_scale`, of mean bands. An edge is where the reference's gradient is at least
/// `full_scale` / 16 a pixel; its shift is the least-squares displacement along the gradient in a window of 5 x 5
/// (B. Lucas, T. Kanade 1981, to first order). A body's centre of light is taken over the pixels that show it
/// through their middles, by `body` (row by row, -1: none), and those within 2 px, but for other bodies' and those
/// near the image's border.
[[nodiscard]] ImageDifference compare(const RadianceImage& picture, const RadianceImage& reference,
                                      std::span<const std::int32_t> body, double full_scale);

}  // namespace narpa
