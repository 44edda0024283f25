/// tests/renderer/camera/star_support.h - skies of a few stars, and what an image has of one.
#pragma once

#include "renderer/camera/star_light.h"
#include "tests/renderer/camera/camera_support.h"

namespace narpa::test {

/// World axes are those of ICRS, the camera's too.
inline Scene sky(const std::vector<Vec3>& directions, double v_magnitude = 0) {
    Scene scene;
    scene.stars.emplace();
    for (const Vec3& d : directions) scene.stars->stars.push_back({normalized(d), v_magnitude, 0.65});
    return scene;
}

/// Of the green band.
struct Spot {
    double sum = 0, x = 0, y = 0;  ///< radiance over all pixels; centroid
};
inline Spot spot_in(const RadianceImage& image, int x_first = 0, int x_end = 1 << 20, int y_first = 0,
                    int y_end = 1 << 20) {
    Spot s;
    for (int y = y_first; y < std::min(y_end, image.height); ++y)
        for (int x = x_first; x < std::min(x_end, image.width); ++x) {
            const double v = static_cast<double>(
                image
                    .pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                            static_cast<std::size_t>(x)]
                    .y);
            s.sum += v, s.x += v * x, s.y += v * y;
        }
    s.x /= s.sum, s.y /= s.sum;
    return s;
}

/// A turn of the camera about an axis (camera axes) within the exposure, about its attitude at rest.
inline CameraPose turning(const Vec3& axis_rad, double row_time = 0) {
    return {{exp_rotation(-0.5 * axis_rad), {}}, {exp_rotation(0.5 * axis_rad), {}}, row_time};
}

}  // namespace narpa::test
