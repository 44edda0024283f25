#include "renderer/trace/camera_image.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <optional>

#include "renderer/trace/camera_ray.h"
#include "renderer/trace/flush_denormals.h"
#include "renderer/trace/sampler.h"
#include "renderer/trace/shading.h"
#include "renderer/trace/sun_disc.h"

namespace narpa {
namespace {

constexpr int kTile = 16;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// What stays the same over a frame.
struct Frame {
    const Tracer& tracer;
    const Placement& at;
    const Camera& camera;
    const Rigid3& T_world_camera;
    const FrameSettings& settings;
    std::optional<SunDisc> sun;
};

/// Radiance that leaves the hit along the ray, back to its origin. The only light is direct.
Rgb outgoing_radiance(const Frame& f, const Hit& hit, const Vec3& to_viewer, const Vec3& to_sun) {
    const Surface surface = surface_at(f.tracer.scene(), hit);
    Rgb radiance = surface.emission + f.tracer.scene().ambient * ambient_reflectance(surface);
    if (!f.sun) return radiance;
    const double cosine = dot(hit.shading_normal, to_sun);
    if (cosine <= 0) return radiance;
    const Rgb reflected = brdf(surface, hit.shading_normal, to_sun, to_viewer);
    if (reflected == Rgb{} || f.tracer.occluded(f.at, hit, to_sun, kInfinity)) return radiance;
    return radiance + reflected * (f.sun->irradiance() * static_cast<float>(cosine));
}

/// Mean of the three bands: what a monochrome sensor would weigh.
double mean_band(const Vec3& radiance) {
    return (radiance.x + radiance.y + radiance.z) / 3;
}

struct PixelMean {
    Vec3 radiance{};
    double variance = 0;  ///< of the mean of the bands
};

PixelMean sample_pixel(const Frame& f, int x, int y) {
    const PixelSampler sampler(
        f.settings.seed, f.settings.frame,
        static_cast<std::uint32_t>(y) * static_cast<std::uint32_t>(f.camera.width) + static_cast<std::uint32_t>(x));
    Vec3 sum{};
    double mean = 0, deviations = 0;  // Welford's running variance
    for (int s = 0; s < f.settings.spp; ++s) {
        const SamplePoint p = sampler.point(static_cast<std::uint32_t>(s));
        const Ray ray = camera_ray(f.camera, f.T_world_camera, x + p[0] - 0.5, y + p[1] - 0.5);
        const Hit hit = f.tracer.intersect(f.at, ray, kInfinity);
        Vec3 radiance{};
        if (hit.body >= 0)
            radiance = vec_cast<double>(
                outgoing_radiance(f, hit, -ray.direction, f.sun ? f.sun->sample(p[2], p[3]) : Vec3{}));
        sum += radiance;
        const double delta = mean_band(radiance) - mean;
        mean += delta / (s + 1);
        deviations += delta * (mean_band(radiance) - mean);
    }
    const double n = f.settings.spp;
    return {sum / n, deviations / (n * (n - 1))};
}

void store_aovs(const Frame& f, const Ray& ray, const Hit& hit, std::size_t i, Aovs& aovs) {
    const bool seen = hit.body >= 0;
    aovs.body[i] = hit.body;
    aovs.range_m[i] = seen ? hit.range_m : kInfinity;
    const Vec3 axis = f.T_world_camera.q * Vec3{0, 0, 1};
    aovs.depth_m[i] = seen ? hit.range_m * dot(ray.direction, axis) : kInfinity;
    aovs.position[i] = seen ? hit.position : Vec3{};
    aovs.normal[i] = seen ? hit.shading_normal : Vec3{};
    aovs.variance[i] = 0;
}

void render_pixel(const Frame& f, int x, int y, RadianceImage& out, Aovs* aovs) {
    const std::size_t i =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(out.width) + static_cast<std::size_t>(x);
    const bool many = f.settings.spp > 1;
    if (!many || aovs != nullptr) {
        const Ray ray = camera_ray(f.camera, f.T_world_camera, x, y);
        const Hit hit = f.tracer.intersect(f.at, ray, kInfinity);
        if (!many)
            out.pixels[i] =
                hit.body < 0 ? Rgb{} : outgoing_radiance(f, hit, -ray.direction, f.sun ? f.sun->centre() : Vec3{});
        if (aovs != nullptr) store_aovs(f, ray, hit, i, *aovs);
    }
    if (many) {
        const PixelMean pixel = sample_pixel(f, x, y);
        out.pixels[i] = vec_cast<float>(pixel.radiance);
        if (aovs != nullptr) aovs->variance[i] = static_cast<float>(pixel.variance);
    }
}

void resize(Aovs& a, std::size_t n) {
    a.range_m.resize(n);
    a.depth_m.resize(n);
    a.position.resize(n);
    a.normal.resize(n);
    a.body.resize(n);
    a.variance.resize(n);
}

}  // namespace

void render_radiance(const Tracer& tracer, const Placement& at, const Camera& camera, const Rigid3& T_world_camera,
                     const FrameSettings& settings, RadianceImage& out, Aovs* aovs) {
    const Frame frame{tracer,   at,
                      camera,   T_world_camera,
                      settings, tracer.scene().sun ? std::optional<SunDisc>(*tracer.scene().sun) : std::nullopt};
    if (aovs != nullptr) resize(*aovs, out.pixels.size());
    tbb::parallel_for(
        tbb::blocked_range2d<int>(0, out.height, kTile, 0, out.width, kTile),
        [&](const tbb::blocked_range2d<int>& tile) {
            const FlushDenormals flush;
            for (int y = tile.rows().begin(); y != tile.rows().end(); ++y)
                for (int x = tile.cols().begin(); x != tile.cols().end(); ++x) render_pixel(frame, x, y, out, aovs);
        },
        tbb::simple_partitioner());
}

}  // namespace narpa
