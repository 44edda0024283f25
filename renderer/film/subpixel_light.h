/// renderer/film/subpixel_light.h - the light of tiny bodies, put into their pixels.
#pragma once

#include "renderer/image/radiance_image.h"
#include "renderer/integrator/integrator.h"

namespace narpa {

/// Pixels that are traced together: a square of the image, cut off at its edges, row by row.
struct PixelBlock {
    std::size_t n = 0;
    int x_first = 0, y_first = 0, width = 0, height = 0;
    Lanes<int> x, y;

    [[nodiscard]] std::size_t index(std::size_t i, int image_width) const {
        return static_cast<std::size_t>(y[i]) * static_cast<std::size_t>(image_width) +
               static_cast<std::size_t>(x[i]);
    }
    /// Which of them holds this image point; n: none.
    [[nodiscard]] std::size_t holding(double image_x, double image_y) const;
};

/// Samples of each tiny body's disc: spp for each pixel that its image and the lens's blur cover, within these
/// limits. Any that is spread over several blocks is divided among them.
inline constexpr std::uint32_t kTinySamplesLeast = 1024, kTinySamplesMost = 16384;

/// Adds the light of the tiny bodies in the block to its pixels, which hold what is seen past them, and takes away
/// what they cover. Their points are fixed on the disc, whatever pixels it falls on, so that the light does not
/// change while the body moves through the image. Each point stands for its part of the solid angle, traced like a
/// camera ray and counted if it meets the body: nearer bodies hide it. `variance` may be null; the light's is that
/// of independent samples, which stratified ones stay below.
void add_tiny_bodies(const Frame& f, const PixelBlock& block, RadianceImage& out, std::vector<float>* variance);

}  // namespace narpa
