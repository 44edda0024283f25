/// emulator/replay/image_compare.h - the difference of an image from a reference of the same view: radiance,
/// structure, and shifts of edges and bodies.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "renderer/frame/camera_image.h"

namespace narpa {

/// Signed distances, px.
struct ShiftStatistics {
    std::size_t count = 0;
    double mean_px = 0, rms_px = 0, p99_px = 0;  ///< p99_px: of the magnitude
};

struct BodyShift {
    int body = 0;
    double x_px = 0, y_px = 0;  ///< of the centre of brightness, from the reference to the image
};

struct ImageDifference {
    double rmse = 0;                ///< of the mean band, W m^-2 sr^-1
    double bias = 0;                ///< mean of image - reference, W m^-2 sr^-1
    double full_scale = 0;          ///< radiance that `rmse` and `bias` are fractions of
    double ssim = 1;                ///< mean structural similarity; 1: identical
    ShiftStatistics edges;          ///< along the reference's gradient, at each edge pixel
    std::vector<BodyShift> bodies;  ///< visible bodies that can be measured
};

/// Compares an image with a reference of the same size.
///
/// Structural similarity as Z. Wang, A. Bovik, H. Sheikh, E. Simoncelli, "Image quality assessment: from error
/// visibility to structural similarity", IEEE Trans. Image Processing 13(4), 2004: Gaussian window of 1.5 px,
/// K1 = 0.01, K2 = 0.03, range `full_scale`, of mean bands. An edge is where the reference's gradient is at least
/// `full_scale` / 16 per pixel; its shift is the least-squares displacement along the gradient in a window of 5 x 5
/// (B. Lucas, T. Kanade 1981, to first order). A body's centre of brightness is taken over the pixels whose
/// centre shows it, by `body` (row by row, -1: none), and those within 2 px, except pixels of other bodies and near
/// the image border.
[[nodiscard]] ImageDifference compare(const RadianceImage& picture, const RadianceImage& reference,
                                      std::span<const std::int32_t> body, double full_scale);

}  // namespace narpa
