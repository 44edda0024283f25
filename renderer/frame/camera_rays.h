/// renderer/frame/camera_rays.h - a batch of camera samples, their rays and first hits.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/frame/frame.h"

namespace narpa {

/// Samples of pixels whose rays are traced together.
struct CameraSamples {
    std::size_t n = 0;
    bool centre = false;          ///< all of them through the pixel's centre; in a frame of one sample a pixel also
                                  ///< through the lens's, and to the Sun's
    Lanes<int> x, y;              ///< pixels
    Lanes<std::uint32_t> number;  ///< of the pixel, row by row
    Lanes<std::uint32_t> sample;  ///< index in the pixel's own sequence; 0 for centres
};

/// Makes the samples' rays and, for integrators with a direct part, their directions to the Sun.
void aim_rays(const Frame& f, const CameraSamples& samples, TracedRays& p);
/// Intersects them, except with subpixel bodies. `bodies`: those that any of the rays may meet.
void find_first_hits(const Frame& f, std::span<const std::uint32_t> bodies, TracedRays& p);

/// Rays through the pixels' centres at mid-exposure and their first hits, subpixel bodies included.
void trace_centres(const Frame& f, const CameraSamples& samples, TracedRays& p);

}  // namespace narpa
