/// renderer/film/tile_output.h - from a tile's samples to the image: means, variances, light of subpixel bodies.
/// Inside frame_passes.cpp alone.
#pragma once

#include "renderer/film/subpixel_light.h"
#include "renderer/film/tile_worker.h"

namespace narpa {

inline std::size_t index_of(int x, int y, int width) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

/// A square of a tile's pixels, from (x, y) in it on.
template <class Tile>
PixelBlock block_of(const Tile& t, int x, int y) {
    PixelBlock b;
    b.x_first = t.x + x, b.y_first = t.y + y;
    b.width = std::min(kBlock, t.width - x), b.height = std::min(kBlock, t.height - y);
    for (int py = b.y_first; py < b.y_first + b.height; ++py)
        for (int px = b.x_first; px < b.x_first + b.width; ++px) b.x[b.n] = px, b.y[b.n] = py, ++b.n;
    return b;
}

template <class Tile>
void add_subpixel_light(const Frame& f, const Tile& t, RadianceImage& out, std::vector<float>* variance) {
    if (!f.tiny.any()) return;
    for (int y = 0; y < t.height; y += kBlock)
        for (int x = 0; x < t.width; x += kBlock) add_subpixel_bodies(f, block_of(t, x, y), out, variance);
}

/// Of each pixel's mean, block by block.
template <class Tile>
void put_variances(const Tile& t, const PerPixel<PixelSamples>& first, const PerPixel<PixelSamples>& by_paths,
                   int image_width, std::vector<float>& variance) {
    for (int by = 0; by < t.height; by += kBlock)
        for (int bx = 0; bx < t.width; bx += kBlock) {
            const PixelBlock block = block_of(t, bx, by);
            for (std::size_t i = 0; i < block.n; ++i) variance[block.index(i, image_width)] = 0;
            for (const auto* part : {&first, &by_paths}) {
                Lanes<PixelSamples> of_block;
                Lanes<double> of_means;
                for (std::size_t i = 0; i < block.n; ++i)
                    of_block[i] = (*part)[place_in_tile(block.x[i] - t.x, block.y[i] - t.y)];
                if (of_block[0].count() == 0) continue;
                variances_of_means(std::span(of_block).first(block.n), of_means);
                for (std::size_t i = 0; i < block.n; ++i)
                    variance[block.index(i, image_width)] += static_cast<float>(of_means[i]);
            }
        }
}

/// The same where pixels have samples of their own number, or show their centres.
template <class Tile>
void put_variances(const Tile& t, const PerPixel<PixelMeans>& means, const TileContrast& contrast, int image_width,
                   std::vector<float>& variance) {
    const auto at_least = [](const PixelMean& mean, float one) {
        if (mean.count() == 0) return 0.0f;
        const float step = mean.count() == 1 ? 0 : mean.step();
        return std::max(step * step, one / static_cast<float>(mean.count()));
    };
    t.each_pixel([&](int x, int y, std::size_t at) {
        const auto& [first, by_paths] = means[at];
        const float reused = contrast.reused[at], one = contrast.edge[at] + std::max(contrast.noise[at], 0.0f);
        const bool alone = first.count() == 0;
        variance[index_of(x, y, image_width)] =
            means[at].count() > 0 ? at_least(first, one) + at_least(by_paths, alone ? one + reused : reused)
                                  : contrast.centre[at];
    });
}

inline Rgb radiance_at(const GBufferTile& tile, std::size_t place) {
    return {tile.r[place], tile.g[place], tile.b[place]};
}

/// Adds the samples of a batch to their pixels.
inline void add_samples(const SampleBatch& b, const PacketLight& light, PerPixel<PixelMeans>& means) {
    for_each_lane(b.first, [&](std::size_t i) { means[b.place[i]].first.add(light.first[i]); });
    for_each_lane(b.by_paths, [&](std::size_t i) { means[b.place[i]].by_paths.add(light.by_paths[i]); });
}

}  // namespace narpa
