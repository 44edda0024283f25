/// base/radiance_image.h - linear radiance of an image, before any detector.
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

/// Arbitrary output variables: the first hit of the ray through each pixel's centre.
/// Background: depth and range infinite, body -1, the rest zero.
struct Aovs {
    std::vector<double> range_m, depth_m;  ///< along the ray; along the camera's z axis
    std::vector<Vec3> position, normal;    ///< world
    std::vector<std::int32_t> body;
    std::vector<Rgb> albedo;  ///< base colour with its texture: a mirror's reflectance, white for glass
    /// Variance of the pixel's mean over the bands, W^2 m^-4 sr^-2 (0 for spp < 2, except for subpixel bodies):
    /// pixel_samples.h describes the estimate and its 95 % interval, frame_error.h the gain of stratification. With
    /// a budget: the expected variance of refined frames, else 0.
    std::vector<float> variance;
};

}  // namespace narpa
