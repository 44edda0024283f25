/// renderer/image/radiance_image.h - linear radiance of an image, before any detector.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/vec3.h"

namespace narpa {

/// Row-major, height x width, linear radiance in W m^-2 sr^-1 a band.
struct RadianceImage {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;

    RadianceImage(int w, int h)
        : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
};

/// Outputs at the first hit through each pixel's centre, wanted only by `narpa render --aov`.
/// Background: depth and range infinite, body -1, the rest zero.
struct Aovs {
    std::vector<double> range_m, depth_m;  ///< along the ray; along the camera's z axis
    std::vector<Vec3> position, normal;    ///< world
    std::vector<std::int32_t> body;
    std::vector<Rgb> albedo;  ///< base colour with its texture: a mirror's reflectance, white for glass
    /// Of the pixel's mean over the bands (0 for spp < 2, but for tiny bodies), W^2 m^-4 sr^-2: pixel_samples.h
    /// says how it is estimated and which 95 % interval goes with it. Within a budget: what a frame expects of
    /// itself (frame_error.h), where it came to refined; else 0.
    std::vector<float> variance;
};

}  // namespace narpa
