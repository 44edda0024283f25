#include "renderer/detector/cosmic_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/detector/collect.h"
#include "renderer/detector/noise.h"

namespace narpa {
namespace {

/// A straight track, in pixels: the pixel of column 0 and row 0 is the square from (0, 0) to (1, 1).
struct Track {
    double x, y;    ///< where it begins
    double dx, dy;  ///< to where it ends
    double charge_e;
};

double unit(std::uint32_t word) noexcept {
    return (word + 0.5) * 0x1p-32;
}

/// One axis of the walk from pixel to pixel.
struct Axis {
    int at, step;
    double next, between;  ///< as fractions of the track: position of the next pixel edge, distance between edges

    Axis(double start, double length) noexcept
        : at(static_cast<int>(start)),
          step(length < 0 ? -1 : 1),
          next(std::numeric_limits<double>::infinity()),
          between(next) {
        if (length == 0) return;
        next = (at + (length > 0 ? 1 : 0) - start) / length;
        between = 1 / std::abs(length);
    }
    void advance() noexcept {
        at += step;
        next += between;
    }
};

/// Each pixel gets the share of the track within it (J. Amanatides, A. Woo, "A fast voxel traversal algorithm for
/// ray tracing", Eurographics 1987).
void deposit(const Track& track, int width, int height, std::span<float> charge_e) noexcept {
    Axis x(track.x, track.dx), y(track.y, track.dy);
    for (double from = 0; from < 1 && x.at >= 0 && x.at < width && y.at >= 0 && y.at < height;) {
        const double to = std::min({x.next, y.next, 1.0});
        charge_e[static_cast<std::size_t>(y.at) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(x.at)] += static_cast<float>(track.charge_e * (to - from));
        from = to;
        (x.next < y.next ? x : y).advance();
    }
}

}  // namespace

double mean_cosmic_rays(const Camera& camera) noexcept {
    const Detector& d = *camera.detector;
    const double pixels = static_cast<double>(camera.width) * camera.height;
    const double area_cm2 = pixels * d.pixel_pitch_m * d.pixel_pitch_m * 1e4;
    return std::min(d.cosmic_rays_per_cm2_s * area_cm2 * d.exposure_s, pixels);
}

void add_cosmic_rays(const Camera& camera, const PhiloxSchedule& random, std::uint32_t frame, std::uint32_t band,
                     std::span<float> charge_e) noexcept {
    const Detector& d = *camera.detector;
    const std::uint32_t number_draw = SensorDraw::kHits + 3 * band;
    Lanes<double> mean{};
    mean[0] = mean_cosmic_rays(camera);
    const RandomLanes first = philox(random, 0, frame, number_draw);
    const auto number = static_cast<std::uint32_t>(poisson(mean, normals(first), first)[0]);
    for (std::uint32_t hit = 0; hit < number; hit += kLanes) {
        const RandomLanes place = philox(random, hit, frame, number_draw + 1),
                          direction = philox(random, hit, frame, number_draw + 2);
        for (std::size_t i = 0; i < kLanes && hit + i < number; ++i) {
            const double cosine_squared = unit(direction.w0[i]), cosine = std::sqrt(cosine_squared);
            const SineCosine azimuth = sincos_of_word(direction.w1[i]);
            const double reach =
                d.sensitive_depth_m / d.pixel_pitch_m * std::sqrt(1 - cosine_squared) / cosine;  // px
            deposit({unit(place.w0[i]) * camera.width, unit(place.w1[i]) * camera.height,
                     reach * static_cast<double>(azimuth.cosine), reach * static_cast<double>(azimuth.sine),
                     kCosmicRayElectrons_per_m * d.sensitive_depth_m / cosine},
                    camera.width, camera.height, charge_e);
        }
    }
}

}  // namespace narpa
