/// renderer/film/camera_batch.h - sixteen samples of a camera's image: aimed, traced, lit.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/integrator/integrator.h"

namespace narpa {

/// Which samples are traced together: some of one tile of the image.
struct CameraSamples {
    std::size_t n = 0;
    bool middle = false;          ///< all of them through the middle of the pixel; in a frame of one sample a
                                  ///< pixel through that of the lens too, and to that of the Sun
    Lanes<int> x, y;              ///< pixels
    Lanes<std::uint32_t> number;  ///< of the pixel, row by row
    Lanes<std::uint32_t> sample;  ///< place in the pixel's own sequence; of middles 0
};

/// Aims the samples' rays, finds what they meet, but for tiny bodies, and the light that comes back. `bodies`:
/// those that any of the rays may meet.
void trace_samples(const Frame& f, const CameraSamples& samples, std::span<const std::uint32_t> bodies, Packet& p,
                   RgbLanes& radiance);

/// The first half of that: without the light.
void trace_rays(const Frame& f, const CameraSamples& samples, std::span<const std::uint32_t> bodies, Packet& p);

/// The rays alone, through the pixels' middles, and what they meet, tiny bodies among the rest.
void trace_middles(const Frame& f, const CameraSamples& samples, Packet& p);

}  // namespace narpa
