#include "renderer/trace/camera_image.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
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

constexpr int kBlock = 4;  // pixels a side: kPacket in all
constexpr int kTile = 4;   // blocks a side of what a thread takes at a time
static_assert(kBlock * kBlock == kPacket);
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// What stays the same over a frame.
struct Frame {
    const Tracer& tracer;
    const Placement& at;
    const Camera& camera;
    const Rigid3& T_world_camera;
    const FrameSettings& settings;
    std::optional<SunDisc> sun;
    double pixel_angle_rad;  ///< width of a sample's beam
};

/// Pixels that are traced together: a square of the image, cut off at its edges.
struct Block {
    std::size_t n = 0;
    std::array<int, kPacket> x, y;
    [[nodiscard]] std::size_t index(std::size_t i, int width) const {
        return static_cast<std::size_t>(y[i]) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x[i]);
    }
};

Block block_at(int bx, int by, int width, int height) {
    Block b;
    for (int y = by * kBlock; y < std::min(height, (by + 1) * kBlock); ++y)
        for (int x = bx * kBlock; x < std::min(width, (bx + 1) * kBlock); ++x) b.x[b.n] = x, b.y[b.n] = y, ++b.n;
    return b;
}

template <class T>
using Lanes = std::array<T, kPacket>;

/// Radiance that comes back along each ray, with the light of a point of the Sun for each. Only light that comes
/// straight from its source counts.
void direct_radiance(const Frame& f, std::size_t n, const Lanes<Ray>& rays, const Lanes<Hit>& hits,
                     const Lanes<Vec3>& to_sun, Lanes<Rgb>& radiance) {
    const Scene& scene = f.tracer.scene();
    Lanes<Rgb> sunlit;
    std::uint32_t towards_sun = 0;
    for (std::size_t i = 0; i < n; ++i) {
        radiance[i] = {};
        if (hits[i].body < 0) continue;
        const Surface surface = surface_at(f.tracer, f.at, hits[i], rays[i].direction, hits[i].range_m * f.pixel_angle_rad);
        radiance[i] = surface.emission + scene.ambient * ambient_reflectance(surface);
        if (!f.sun) continue;
        const double cosine = dot(surface.normal, to_sun[i]);
        if (cosine <= 0) continue;
        const Rgb reflected = bsdf(surface, surface.normal, to_sun[i], -rays[i].direction);
        if (reflected == Rgb{}) continue;
        sunlit[i] = reflected * (f.sun->irradiance() * static_cast<float>(cosine));
        towards_sun |= 1u << i;
    }
    if (towards_sun == 0) return;
    const std::uint32_t lit = towards_sun & ~f.tracer.occluded(f.at, std::span(hits).first(n), to_sun, towards_sun);
    for (std::size_t i = 0; i < n; ++i)
        if ((lit >> i & 1u) != 0) radiance[i] += sunlit[i];
}

/// Mean of the three bands: what a monochrome sensor would weigh.
double mean_band(const Vec3& radiance) {
    return (radiance.x + radiance.y + radiance.z) / 3;
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

/// The ray through each pixel's centre: the whole picture for one sample a pixel, and what the other outputs show.
void render_centres(const Frame& f, const Block& block, bool radiance_wanted, RadianceImage& out, Aovs* aovs) {
    Lanes<Ray> rays;
    Lanes<Hit> hits;
    for (std::size_t i = 0; i < block.n; ++i)
        rays[i] = camera_ray(f.camera, f.T_world_camera, block.x[i], block.y[i]);
    f.tracer.intersect(f.at, std::span(rays).first(block.n), hits);
    if (radiance_wanted) {
        Lanes<Vec3> to_sun;
        to_sun.fill(f.sun ? f.sun->centre() : Vec3{});
        Lanes<Rgb> radiance;
        direct_radiance(f, block.n, rays, hits, to_sun, radiance);
        for (std::size_t i = 0; i < block.n; ++i) out.pixels[block.index(i, out.width)] = radiance[i];
    }
    if (aovs != nullptr)
        for (std::size_t i = 0; i < block.n; ++i) store_aovs(f, rays[i], hits[i], block.index(i, out.width), *aovs);
}

/// Mean of several samples a pixel, and the variance of that mean.
void render_samples(const Frame& f, const Block& block, RadianceImage& out, Aovs* aovs) {
    Lanes<Vec3> sum{};
    Lanes<double> mean{}, deviations{};  // Welford's running variance of the mean of the bands
    Lanes<Ray> rays;
    Lanes<Hit> hits;
    Lanes<Vec3> to_sun{};
    Lanes<Rgb> radiance;
    for (int s = 0; s < f.settings.spp; ++s) {
        for (std::size_t i = 0; i < block.n; ++i) {
            const auto pixel = static_cast<std::uint32_t>(block.index(i, out.width));
            const SamplePoint p =
                PixelSampler(f.settings.seed, f.settings.frame, pixel).point(static_cast<std::uint32_t>(s));
            rays[i] = camera_ray(f.camera, f.T_world_camera, block.x[i] + p[0] - 0.5, block.y[i] + p[1] - 0.5);
            if (f.sun) to_sun[i] = f.sun->sample(p[2], p[3]);
        }
        f.tracer.intersect(f.at, std::span(rays).first(block.n), hits);
        direct_radiance(f, block.n, rays, hits, to_sun, radiance);
        for (std::size_t i = 0; i < block.n; ++i) {
            const Vec3 sample = vec_cast<double>(radiance[i]);
            sum[i] += sample;
            const double delta = mean_band(sample) - mean[i];
            mean[i] += delta / (s + 1);
            deviations[i] += delta * (mean_band(sample) - mean[i]);
        }
    }
    const double n = f.settings.spp;
    for (std::size_t i = 0; i < block.n; ++i) {
        const std::size_t at = block.index(i, out.width);
        out.pixels[at] = vec_cast<float>(sum[i] / n);
        if (aovs != nullptr) aovs->variance[at] = static_cast<float>(deviations[i] / (n * (n - 1)));
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
                      settings, tracer.scene().sun ? std::optional<SunDisc>(*tracer.scene().sun) : std::nullopt,
                      1 / (camera.fx * std::sqrt(settings.spp))};
    if (aovs != nullptr) resize(*aovs, out.pixels.size());
    const bool one_sample = settings.spp == 1;
    // Blocks lie on a grid of their own, so that which rays travel together does not depend on the threads.
    const auto blocks = [](int pixels) { return (pixels + kBlock - 1) / kBlock; };
    tbb::parallel_for(
        tbb::blocked_range2d<int>(0, blocks(out.height), kTile, 0, blocks(out.width), kTile),
        [&](const tbb::blocked_range2d<int>& tile) {
            const FlushDenormals flush;
            for (int by = tile.rows().begin(); by != tile.rows().end(); ++by)
                for (int bx = tile.cols().begin(); bx != tile.cols().end(); ++bx) {
                    const Block block = block_at(bx, by, out.width, out.height);
                    if (one_sample || aovs != nullptr) render_centres(frame, block, one_sample, out, aovs);
                    if (!one_sample) render_samples(frame, block, out, aovs);
                }
        },
        tbb::simple_partitioner());
}

}  // namespace narpa
