#include "renderer/detector/cosmic_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/detector/noise.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr TableKey kCosmicRayRows[]{
    {"cosmic_rays_per_cm2_s", rows::number({.low = 0, .high = 1e6})},
    {"sensitive_depth_m", rows::number({.low = 0, .high = 0.01, .low_open = true})},
};

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

class CosmicRayHits final : public DetectorStage {
public:
    explicit CosmicRayHits(const CosmicRays& rays) : rays_(rays) {}
    [[nodiscard]] Place place() const noexcept override { return Place::collection; }
    void act(const ChargePlane& plane) const noexcept override;

private:
    CosmicRays rays_;
};

void CosmicRayHits::act(const ChargePlane& plane) const noexcept {
    const int width = plane.sensor.width, height = plane.sensor.height;
    const std::uint32_t number_draw = SensorDraw::kHits + 3 * plane.band;
    Lanes<double> mean{};
    mean[0] = mean_cosmic_rays(rays_, plane.sensor);
    const RandomLanes first = philox(plane.random, 0, plane.frame, number_draw);
    const auto number = static_cast<std::uint32_t>(poisson(mean, normals(first), first)[0]);
    for (std::uint32_t hit = 0; hit < number; hit += kLanes) {
        const RandomLanes place = philox(plane.random, hit, plane.frame, number_draw + 1),
                          direction = philox(plane.random, hit, plane.frame, number_draw + 2);
        for (std::size_t i = 0; i < kLanes && hit + i < number; ++i) {
            const double cosine_squared = unit(direction.w0[i]), cosine = std::sqrt(cosine_squared);
            const SineCosine azimuth = sincos_of_word(direction.w1[i]);
            const double reach = rays_.sensitive_depth_m / plane.sensor.detector->pixel_pitch_m *
                                 std::sqrt(1 - cosine_squared) / cosine;  // px
            deposit({unit(place.w0[i]) * width, unit(place.w1[i]) * height,
                     reach * static_cast<double>(azimuth.cosine), reach * static_cast<double>(azimuth.sine),
                     kCosmicRayElectrons_per_m * rays_.sensitive_depth_m / cosine},
                    width, height, plane.charge_e);
        }
    }
}

void read_cosmic_rays(TableReader& table, Detector& d) {
    CosmicRays rays;
    table.read("cosmic_rays_per_cm2_s", rays.per_cm2_s);
    table.read("sensitive_depth_m", rays.sensitive_depth_m);
    if (rays.per_cm2_s > 0) d.stages.push_back(cosmic_rays(rays));
}

}  // namespace

std::shared_ptr<const DetectorStage> cosmic_rays(const CosmicRays& rays) {
    return std::make_shared<CosmicRayHits>(rays);
}

double mean_cosmic_rays(const CosmicRays& rays, const ImageSensor& sensor) noexcept {
    const Detector& d = *sensor.detector;
    const double pixels = static_cast<double>(sensor.width) * sensor.height;
    const double area_cm2 = pixels * d.pixel_pitch_m * d.pixel_pitch_m * 1e4;
    return std::min(rays.per_cm2_s * area_cm2 * d.exposure_s, pixels);
}

constinit const DetectorStageKind kCosmicRays{kCosmicRayRows, read_cosmic_rays};

}  // namespace narpa
