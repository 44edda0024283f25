/// renderer/frame/camera_batch.h - a batch of camera samples: their rays and hits.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/integrator/integrator.h"

namespace narpa {

/// Samples of one tile that are traced together.
struct CameraSamples {
    std::size_t n = 0;
    bool centre = false;          ///< all of them through the pixel's centre; in a frame of one sample a pixel also
                                  ///< through the lens's, and to the Sun's
    Lanes<int> x, y;              ///< pixels
    Lanes<std::uint32_t> number;  ///< of the pixel, row by row
    Lanes<std::uint32_t> sample;  ///< index in the pixel's own sequence; 0 for centres
};

/// Aims the samples' rays and intersects them, except with subpixel bodies. `bodies`: those that any of the rays
/// may meet.
void trace_rays(const Frame& f, const CameraSamples& samples, std::span<const std::uint32_t> bodies,
                CameraBatch& p);

/// The same for rays through the pixels' centres, subpixel bodies included.
void trace_centres(const Frame& f, const CameraSamples& samples, CameraBatch& p);

}  // namespace narpa
