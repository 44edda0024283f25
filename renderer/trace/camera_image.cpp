#include "renderer/trace/camera_image.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <algorithm>

#include "renderer/trace/camera_packet.h"
#include "renderer/trace/first_hit.h"
#include "renderer/trace/flush_denormals.h"
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

/// A sample of each of the block's pixels.
CameraSamples samples_of(const PixelBlock& block, int image_width, bool middle) {
    CameraSamples s;
    s.n = block.n;
    s.middle = middle;
    s.sample.fill(0);
    for (std::size_t i = 0; i < block.n; ++i) {
        s.x[i] = block.x[i], s.y[i] = block.y[i];
        s.number[i] = static_cast<std::uint32_t>(block.index(i, image_width));
    }
    return s;
}

/// The ray through each pixel's middle: what the outputs beside the radiance show.
void store_first_hits(const Frame& f, const PixelBlock& block, int image_width, Packet& p, Aovs& aovs) {
    trace_middles(f, samples_of(block, image_width, true), p);
    for (std::size_t i = 0; i < block.n; ++i)
        store_first_hit(f, p.rays[i], p.hits[i], block.index(i, image_width), aovs);
}

/// The same ray: the whole picture for one sample a pixel.
void render_middles(const Frame& f, const PixelBlock& block, Packet& p, RadianceImage& out) {
    RgbPerRay radiance;
    trace_samples(f, samples_of(block, out.width, true), f.tracer.all_bodies(), p, radiance);
    for (std::size_t i = 0; i < block.n; ++i) out.pixels[block.index(i, out.width)] = radiance[i];
}

/// Mean of several samples a pixel, and the variance of that mean.
void render_samples(const Frame& f, const PixelBlock& block, Packet& p, RadianceImage& out, Aovs* aovs) {
    Lanes<PixelSamples> samples;
    RgbPerRay radiance;
    CameraSamples wanted = samples_of(block, out.width, false);
    for (int s = 0; s < f.settings.spp; ++s) {
        wanted.sample.fill(static_cast<std::uint32_t>(s));
        trace_samples(f, wanted, f.tracer.all_bodies(), p, radiance);
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
        render_middles(f, block, p, out);
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
