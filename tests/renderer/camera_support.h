/// tests/renderer/camera_support.h - what a camera measures of a whole image.
#pragma once

#include <cmath>

#include "renderer/film/camera_image.h"

namespace narpa::test {

/// Irradiance at the camera in the green band, W m^-2: radiance times solid angle over all pixels.
inline double irradiance(const RadianceImage& image, const Camera& c) {
    double sum = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double u = (x - c.cx) / c.fx, v = (y - c.cy) / c.fy, cosine = 1 / std::sqrt(1 + u * u + v * v);
            sum += static_cast<double>(image.pixels[static_cast<std::size_t>(y * image.width + x)].y) * cosine *
                   cosine * cosine / (c.fx * c.fy);
        }
    return sum;
}

}  // namespace narpa::test
