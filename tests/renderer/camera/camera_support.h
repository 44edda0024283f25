/// tests/renderer/camera/camera_support.h - an image of a scene, and what a camera measures of a whole image.
#pragma once

#include <gtest/gtest.h>

#include <cmath>

#include "renderer/atmosphere/air.h"
#include "renderer/frame/camera_image.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa::test {

/// The Earth's air, sampled coarsely: for tests that do not ask how well.
inline Atmosphere coarse_earth_air() {
    Atmosphere a;
    a.air = earth_air();
    a.samples_per_band = 1, a.steps = 4;
    return a;
}

inline RadianceImage rendered(const RenderScene& render_scene, const BodyPoses& at, const Camera& c,
                              const CameraPose& pose = {}, const FrameSettings& settings = {},
                              Aovs* aovs = nullptr) {
    RadianceImage image(c.width, c.height);
    render_radiance(render_scene, at, c, pose, settings, image, aovs);
    return image;
}
inline RadianceImage rendered(const Scene& scene, const BodyPoses& at, const Camera& c, const CameraPose& pose = {},
                              const FrameSettings& settings = {}, Aovs* aovs = nullptr) {
    const auto render_scene = RenderScene::create(scene, 1);
    EXPECT_TRUE(render_scene);
    return rendered(*render_scene, at, c, pose, settings, aovs);
}
/// All bodies are where the scene puts them at time 0.
inline RadianceImage rendered(const Scene& scene, const Camera& c, const CameraPose& pose = {},
                              const FrameSettings& settings = {}, Aovs* aovs = nullptr) {
    return rendered(scene, placed(scene), c, pose, settings, aovs);
}

/// Irradiance at the camera in the green band, W m^-2: radiance times solid angle over all pixels.
inline double irradiance(const RadianceImage& image, const Camera& c) {
    const Pinhole p = pinhole_of(c);
    double sum = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double u = (x - p.cx) / p.fx, v = (y - p.cy) / p.fy, cosine = 1 / std::sqrt(1 + u * u + v * v);
            sum += static_cast<double>(image.pixels[static_cast<std::size_t>(y * image.width + x)].y) * cosine *
                   cosine * cosine / (p.fx * p.fy);
        }
    return sum;
}

}  // namespace narpa::test
