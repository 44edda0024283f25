#include "renderer/trace/camera_image.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "renderer/trace/camera_ray.h"
#include "renderer/trace/first_hit.h"
#include "renderer/trace/flush_denormals.h"
#include "renderer/trace/frame_light.h"
#include "renderer/trace/lens.h"
#include "renderer/trace/pixel_samples.h"
#include "renderer/trace/tiny_light.h"

namespace narpa {
namespace {

constexpr int kBlock = 4;  // pixels a side: kPacket in all
constexpr int kTile = 4;   // blocks a side of what a thread takes at a time
static_assert(kBlock * kBlock == kPacket);

PixelBlock block_at(int bx, int by, int width, int height) {
    PixelBlock b;
    b.x_first = bx * kBlock, b.y_first = by * kBlock;
    b.width = std::min(width - b.x_first, kBlock), b.height = std::min(height - b.y_first, kBlock);
    for (int y = b.y_first; y < b.y_first + b.height; ++y)
        for (int x = b.x_first; x < b.x_first + b.width; ++x) b.x[b.n] = x, b.y[b.n] = y, ++b.n;
    return b;
}

/// Finds what the packet's rays meet and the light that comes back from there.
void trace(const Frame& f, Packet& p, Lanes<Rgb>& radiance) {
    f.tracer.intersect(f.at, std::span(p.rays).first(p.n), p.hits);
    if (f.tiny.any())
        for (std::size_t i = 0; i < p.n; ++i) p.hits[i] = f.tiny.beyond(p.rays[i], p.hits[i]);
    light_along(f, p, radiance);
}

void set_numbers(const PixelBlock& block, int image_width, Packet& p) {
    for (std::size_t i = 0; i < block.n; ++i) p.number[i] = static_cast<std::uint32_t>(block.index(i, image_width));
}

void aim_at_centres(const Frame& f, const PixelBlock& block, Packet& p) {
    p.n = block.n;
    for (std::size_t i = 0; i < block.n; ++i)
        p.rays[i] = camera_ray(f.camera, f.T_world_camera, block.x[i], block.y[i]);
}

/// The ray through each pixel's centre: what the outputs beside the radiance show.
void store_first_hits(const Frame& f, const PixelBlock& block, int image_width, Packet& p, Aovs& aovs) {
    aim_at_centres(f, block, p);
    f.tracer.intersect(f.at, std::span(p.rays).first(p.n), p.hits);
    for (std::size_t i = 0; i < block.n; ++i)
        store_first_hit(f, p.rays[i], p.hits[i], block.index(i, image_width), aovs);
}

/// The same ray: the whole picture for one sample a pixel.
void render_centres(const Frame& f, const PixelBlock& block, Packet& p, RadianceImage& out) {
    Lanes<Rgb> radiance;
    aim_at_centres(f, block, p);
    if (f.sun) p.to_sun.fill(f.sun->centre());
    if (!f.quick) set_numbers(block, out.width, p);
    trace(f, p, radiance);
    for (std::size_t i = 0; i < block.n; ++i) out.pixels[block.index(i, out.width)] = radiance[i];
}

/// Points the packet's rays at this sample of each pixel.
void aim(const Frame& f, const PixelBlock& block, std::uint32_t sample, Packet& p) {
    p.sample = sample;
    for (std::size_t i = 0; i < block.n; ++i) {
        const PixelSampler sampler(f.settings.seed, f.settings.frame, p.number[i]);
        const SamplePoint u = sampler.point(sample);
        const double x = block.x[i] + u[0] - 0.5, y = block.y[i] + u[1] - 0.5;
        if (f.lens == nullptr) {
            p.rays[i] = camera_ray(f.camera, f.T_world_camera, x, y);
            if (f.sun) p.to_sun[i] = f.sun->sample(u[2], u[3]);
        } else {
            p.rays[i] = lens_ray(f.camera, *f.lens, f.T_world_camera, x, y, aperture_point(*f.lens, u[2], u[3]));
            if (!f.sun || !f.quick) continue;
            const SamplePoint more = sampler.point(sample, 1);
            p.to_sun[i] = f.sun->sample(more[0], more[1]);
        }
    }
}

/// Mean of several samples a pixel, and the variance of that mean.
void render_samples(const Frame& f, const PixelBlock& block, Packet& p, RadianceImage& out, Aovs* aovs) {
    Lanes<PixelSamples> samples;
    Lanes<Rgb> radiance;
    p.n = block.n;
    set_numbers(block, out.width, p);
    for (int s = 0; s < f.settings.spp; ++s) {
        aim(f, block, static_cast<std::uint32_t>(s), p);
        trace(f, p, radiance);
        for (std::size_t i = 0; i < block.n; ++i) samples[i].add(radiance[i]);
    }
    for (std::size_t i = 0; i < block.n; ++i)
        out.pixels[block.index(i, out.width)] = vec_cast<float>(samples[i].mean());
    if (aovs == nullptr) return;
    Lanes<double> variance;
    variances_of_means(std::span(samples).first(block.n), variance);
    for (std::size_t i = 0; i < block.n; ++i)
        aovs->variance[block.index(i, out.width)] = static_cast<float>(variance[i]);
}

void render_block(const Frame& f, const PixelBlock& block, Packet& p, RadianceImage& out, Aovs* aovs) {
    if (aovs != nullptr) store_first_hits(f, block, out.width, p, *aovs);
    if (f.one_sample())
        render_centres(f, block, p, out);
    else
        render_samples(f, block, p, out, aovs);
    if (f.tiny.any()) add_tiny_bodies(f, block, out, aovs != nullptr ? &aovs->variance : nullptr);
    if (f.settings.pixels_done != nullptr) f.settings.pixels_done->fetch_add(block.n, std::memory_order_relaxed);
}

using Tile = tbb::blocked_range2d<int>;  // of blocks

void render_tile(const Frame& f, const Tile& tile, RadianceImage& out, Aovs* aovs) {
    const FlushDenormals flush;
    Packet packet;  // large, so made once
    for (int by = tile.rows().begin(); by != tile.rows().end(); ++by)
        for (int bx = tile.cols().begin(); bx != tile.cols().end(); ++bx)
            render_block(f, block_at(bx, by, out.width, out.height), packet, out, aovs);
}

}  // namespace

void render_radiance(const Tracer& tracer, const Placement& at, const Camera& camera, const Rigid3& T_world_camera,
                     const FrameSettings& settings, RadianceImage& out, Aovs* aovs) {
    const Frame frame = make_frame(tracer, at, camera, T_world_camera, settings);
    if (aovs != nullptr) resize(*aovs, out.pixels.size());
    // Blocks lie on a grid of their own, so that which rays travel together does not depend on the threads.
    const auto blocks = [](int pixels) { return (pixels + kBlock - 1) / kBlock; };
    tbb::parallel_for(
        Tile(0, blocks(out.height), kTile, 0, blocks(out.width), kTile),
        [&](const Tile& tile) { render_tile(frame, tile, out, aovs); }, tbb::simple_partitioner());
}

}  // namespace narpa
