/// renderer/frame/subpixel/subpixel_light.h - adds the light of subpixel bodies to the image.
#pragma once

#include "base/radiance_image.h"
#include "renderer/frame/frame.h"

namespace narpa {

/// A square of pixels, clipped at the image's edges, row-major.
struct PixelBlock {
    std::size_t n = 0;
    int x_first = 0, y_first = 0, width = 0, height = 0;
    Lanes<int> x, y;

    [[nodiscard]] std::size_t index(std::size_t i, int image_width) const {
        return static_cast<std::size_t>(y[i]) * static_cast<std::size_t>(image_width) +
               static_cast<std::size_t>(x[i]);
    }
};

/// Limits of the number of samples of each subpixel body's disc: spp for each pixel that its image and the lens's
/// blur cover. The samples of a disc that spans several blocks are divided among them.
inline constexpr std::uint32_t kSubpixelSamplesLeast = 1024, kSubpixelSamplesMost = 16384;

/// Adds the light of the subpixel bodies in the block to its pixels, which hold the light from behind them, and
/// removes what they cover. The sample points are fixed on the disc, whatever pixels it falls on, so the light does
/// not change while the body moves through the image. If the camera has a point spread function, a point's light is
/// shared among pixels by cubic interpolation, so that the filtered image has its centroid at the point. Each point
/// represents its part of the solid angle, is traced like a camera ray, and counts only if it hits the body, so
/// nearer bodies occlude it. `variance` may be null; it gets the variance of independent samples, an upper bound
/// for stratified ones. `bodies`: those that may be in the block.
void add_subpixel_bodies(const Frame& f, const PixelBlock& block, std::span<const std::uint32_t> bodies,
                         RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
