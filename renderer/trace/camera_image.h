/// renderer/trace/camera_image.h - a camera's linear radiance image, and the exact outputs beside it.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/trace/tracer.h"

namespace narpa {

/// Outputs at the first hit through each pixel's centre, wanted only by `narpa render --aov`.
/// Background: depth and range infinite, body -1, the rest zero.
struct Aovs {
    std::vector<double> range_m, depth_m;  ///< along the ray; along the camera's z axis
    std::vector<Vec3> position, normal;    ///< world
    std::vector<std::int32_t> body;
    std::vector<float> variance;  ///< of the pixel's mean over the bands, from its samples (0 for spp < 2)
};

/// Row-major, height x width, linear radiance in W m^-2 sr^-1 a band.
struct RadianceImage {
    int width = 0, height = 0;
    std::vector<Rgb> pixels;

    RadianceImage(int w, int h)
        : width(w), height(h), pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}
};

struct FrameSettings {
    int spp = 1;             ///< 1: the ray through each pixel's centre
    std::uint64_t seed = 0;  ///< scene seed; samples depend on (seed, frame, pixel, sample) and nothing else
    std::uint32_t frame = 0;
};

/// Light that reaches the camera over one surface: sunlight with its shadow, ambient (never shadowed), emission;
/// black where nothing is hit. With spp = 1 the Sun is the centre of its disc, with more each sample takes a point
/// of the disc, so shadows have their penumbra. No light goes from surface to surface yet.
///
/// Runs on the calling thread's TBB arena. Same bytes whatever the number of threads. After a first call with the
/// same sizes it allocates nothing. `aovs` may be null.
void render_radiance(const Tracer& tracer, const Placement& at, const Camera& camera, const Rigid3& T_world_camera,
                     const FrameSettings& settings, RadianceImage& out, Aovs* aovs = nullptr);

/// Shot and return of a LiDAR or any other range finder.
struct LidarReturn {
    double range_m = 0;  ///< 0: no return
    float reflectivity =
        0;  ///< diffuse reflectance seen along the beam: pi * BRDF(-d, -d) * cos(incidence), mean of bands
    int body = -1;
};
/// One ray; its bodies where they are at the shot's own time.
[[nodiscard]] LidarReturn shoot(const Tracer& tracer, const Placement& at, const Ray& beam,
                                double range_max_m) noexcept;

}  // namespace narpa
