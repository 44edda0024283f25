/// renderer/film/camera_batch.h - a batch of samples of a camera's image: their rays, and what these meet.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/integrator/integrator.h"

namespace narpa {

/// Samples that are traced together, of one tile of the image.
struct CameraSamples {
    std::size_t n = 0;
    bool centre = false;          ///< all of them through the pixel's centre; in a frame of one sample a pixel also
                                  ///< through the lens's, and to the Sun's
    Lanes<int> x, y;              ///< pixels
    Lanes<std::uint32_t> number;  ///< of the pixel, row by row
    Lanes<std::uint32_t> sample;  ///< place in the pixel's own sequence; of centres 0
};

/// Aims the samples' rays and finds what they meet, but for subpixel bodies. `bodies`: those that any of the rays
/// may meet.
void trace_rays(const Frame& f, const CameraSamples& samples, std::span<const std::uint32_t> bodies,
                CameraBatch& p);

/// The rays through the pixels' centres and what they meet, subpixel bodies included.
void trace_centres(const Frame& f, const CameraSamples& samples, CameraBatch& p);

}  // namespace narpa
