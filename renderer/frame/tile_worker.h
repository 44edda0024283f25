/// renderer/frame/tile_worker.h - traces and shades a tile's samples: Worker::trace shows the whole way from pixels
/// to accumulated samples. Used only by frame_passes.cpp.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cassert>
#include <cstdint>
#include <cstring>
#include <span>

#include "renderer/frame/camera_rays.h"
#include "renderer/frame/frame_passes.h"
#include "renderer/frame/subpixel/subpixel_light.h"
#include "renderer/frame/tuning.h"

namespace narpa {

/// First random sequence of centres in frames that add samples; distinct from those of the pixels, because the
/// centres decide how many samples a pixel gets.
inline constexpr std::uint32_t kFirstCentre = 0x40000000u;
inline constexpr int kBlock = 4;
inline constexpr std::uint64_t kAllPlaces = ~std::uint64_t{0};  ///< of a tile

struct FramePasses::Tile {
    std::uint32_t index;
    int x, y, width, height;  ///< pixels
    std::span<const std::uint32_t> bodies;

    [[nodiscard]] bool whole() const { return width == kTile && height == kTile; }
    template <class Do>
    void each_pixel(Do&& act) const {
        for (int block = 0; block < 4; ++block)
            for (int row = 0; row < kBlock; ++row)
                for (int column = 0; column < kBlock; ++column) {
                    const int px = block % 2 * kBlock + column, py = block / 2 * kBlock + row;
                    if (px < width && py < height) act(x + px, y + py, place_in_tile(px, py));
                }
    }
};

/// Samples that are traced together.
struct SampleBatch {
    CameraSamples samples;
    Lanes<std::uint8_t> place;  ///< index of each sample's pixel in the tile
    std::uint32_t direct_lanes = 0,
                  path_lanes = 0;  ///< the lanes that count for this part of the light (BatchRadiance)

    void add(int x, int y, std::size_t at, std::uint32_t number, std::uint32_t sample) {
        assert(samples.n < kLanes && at < kTilePixels);
        const std::size_t i = samples.n++;
        samples.x[i] = x, samples.y[i] = y;
        samples.number[i] = number, samples.sample[i] = sample;
        place[i] = static_cast<std::uint8_t>(at);
    }
};

/// Per-task state for several tiles; large.
class FramePasses::Worker {
public:
    /// Memory for batches that are shaded together.
    template <std::size_t N>
    struct Storage {
        std::array<TracedRays, N> traced;
        std::array<SampleBatch, N> batches;
    };

    template <std::size_t N>
    Worker(const Frame& frame, const PassLimit& limit, std::atomic<bool>& stop, PhaseTimes* times,
           Storage<N>& storage)
        : f(frame), until_ns_(limit.until_ns), stop_(stop), traced_(storage.traced), batches_(storage.batches) {
        for (TracedRays& p : traced_) p.times = times;
    }

    const Frame& f;
    FrameError error;
    bool with_paths = true;  ///< false: only the direct part of a frame in two parts (BatchRadiance)

    /// Of all samples so far.
    [[nodiscard]] PassCount count() const {
        PassCount sum = count_;
        for (const TracedRays& p : traced_) sum.rays += p.rays_traced, sum.path_rays += p.path_rays;
        return sum;
    }
    void read_clock() {
        if (until_ns_ != PassLimit{}.until_ns && now_ns() >= until_ns_)
            stop_.store(true, std::memory_order_relaxed);
    }

    /// Traces samples `begin(at)` to `end(at)` - 1 of each pixel's sequence; `at`: the pixel's index in the tile.
    /// Paths are traced together for up to kMaxPixelSamples samples per pixel, so that neighbours can reuse them.
    /// Calls `accumulate(batch, rays, light)` for the samples in order.
    template <class Begin, class End, class Accumulate>
    void samples(const Tile& tile, int image_width, Begin&& begin, End&& end, Accumulate&& accumulate) {
        const bool has_paths = f.parts != LightParts::direct && with_paths;
        const std::uint32_t most = has_paths ? kMaxPixelSamples : PixelRange::kAll;
        bool left = true;
        for (std::uint32_t done = 0; left; done += most) {
            left = false;
            const auto place = [&](auto&& add, auto&&) {
                tile.each_pixel([&](int x, int y, std::size_t at) {
                    const PixelRange range{begin(at), end(at)};
                    const auto number = static_cast<std::uint32_t>(y * image_width + x);
                    left = left || range.size() > done + most;
                    for (std::uint32_t s = range.from(done); s < range.from(done + most); ++s)
                        add(x, y, at, number, s);
                });
            };
            trace(tile, false, place, accumulate);
        }
    }

    /// Traces the centres of pixels: a bit of `places` for each place in the tile.
    template <class Accumulate>
    void centres(const Tile& tile, int width, std::uint64_t places, Accumulate&& accumulate) {
        const std::uint32_t first = first_centre();
        const auto place = [&](auto&& add, auto&& add_block) {
            if (places == kAllPlaces && tile.whole()) {
                for (int block = 0; block < 4; ++block)
                    add_block([&](SampleBatch& b) { put_block(tile, block, first, width, b); });
                return;
            }
            tile.each_pixel([&](int x, int y, std::size_t at) {
                if ((places >> at & 1) != 0) add(x, y, at, first + static_cast<std::uint32_t>(y * width + x), 0);
            });
        };
        trace(tile, true, place, accumulate);
    }
    /// The same, stored in the G-buffer.
    void centres(const Tile& tile, int width, std::uint64_t places, GBuffer& g_buffer) {
        centres(tile, width, places, [&](const SampleBatch& b, const TracedRays& p, const BatchRadiance& l) {
            g_buffer.store(f, p, l, b.place, tile.index);
        });
    }

    /// Traces the centres of a few pixels of a tile, stored in the G-buffer, together with those of the next tiles:
    /// a batch takes the same time whether it is full or not. `flush` traces those that are left.
    void gather_centres(const Tile& tile, int width, std::uint64_t places, GBuffer& g_buffer) {
        if (!std::ranges::equal(tile.bodies, gathered_bodies_)) flush();
        gathered_bodies_ = tile.bodies;
        gathered_for_ = &g_buffer;
        tile.each_pixel([&](int x, int y, std::size_t at) {
            if ((places >> at & 1) == 0) return;
            gathered_tile_[gathered_.samples.n] = tile.index;
            gathered_.add(x, y, at, first_centre() + static_cast<std::uint32_t>(y * width + x), 0);
            if (gathered_.samples.n == kLanes) flush();
        });
    }
    void flush() {
        SampleBatch& b = gathered_;
        if (stop_.load(std::memory_order_relaxed)) b.samples.n = 0;
        if (b.samples.n == 0) return;
        std::array<BatchRadiance, 1> light;
        TracedRays& p = traced_[0];
        b.samples.centre = true;
        aim_rays(f, b.samples, p);
        find_first_hits(f, gathered_bodies_, p);
        choose_parts(b, p);
        f.integrator.radiance(f.transport, traced_.first(1), light);
        gathered_for_->store(f, p, light[0], b.place, gathered_tile_);
        count_batch(b, p);
        b.samples.n = 0;
    }

private:
    [[nodiscard]] std::uint32_t first_centre() const {
        return f.settings.budget.kind == FrameBudget::Kind::samples ? 0 : kFirstCentre;
    }
    /// A range of a pixel's sample sequence.
    struct PixelRange {
        static constexpr std::uint32_t kAll = ~0u;
        std::uint32_t begin, end;
        [[nodiscard]] std::uint32_t size() const { return end - begin; }
        [[nodiscard]] std::uint32_t from(std::uint32_t n) const { return begin + std::min(n, size()); }
    };

    /// The way of all light of an image: from pixels to rays, first hits, radiance, and to the pixels' sums.
    ///
    /// Sixteen samples make a batch of rays; several batches are shaded together. What the samples are is decided
    /// by `place(add, add_block)`, what becomes of their radiance by `accumulate`.
    template <class Place, class Accumulate>
    void trace(const Tile& tile, bool centre, Place&& place, Accumulate&& accumulate) {
        const auto shade = [&] {
            std::array<BatchRadiance, kMaxBatches> light;
            if (full_ > 0) f.integrator.radiance(f.transport, traced_.first(full_), light);  // radiance
            for (std::size_t k = 0; k < full_; ++k) {
                accumulate(batches_[k], traced_[k], light[k]);  // accumulated samples
                count_batch(batches_[k], traced_[k]);
                batches_[k].samples.n = 0;
            }
            full_ = 0;
        };
        const auto trace_batch = [&] {
            SampleBatch& b = batches_[full_];
            if (stop_.load(std::memory_order_relaxed)) b.samples.n = 0;
            if (b.samples.n == 0) return;
            TracedRays& p = traced_[full_++];
            b.samples.centre = centre;
            aim_rays(f, b.samples, p);  // rays
            find_first_hits(f, tile.bodies, p);
            choose_parts(b, p);
            if (full_ == traced_.size()) shade();
        };
        place(
            [&](int x, int y, std::size_t at, std::uint32_t number, std::uint32_t sample) {  // pixels
                batches_[full_].add(x, y, at, number, sample);
                if (batches_[full_].samples.n == kLanes) trace_batch();
            },
            [&](auto&& put) {
                put(batches_[full_]);
                trace_batch();
            });
        trace_batch();
        shade();
    }

    /// The lanes that count for each part of the light.
    void choose_parts(SampleBatch& b, TracedRays& p) const {
        const std::uint32_t all = lanes_below(b.samples.n);
        b.direct_lanes = f.parts == LightParts::path ? 0 : all;
        b.path_lanes = f.parts == LightParts::direct || !with_paths ? 0 : all;
        if (f.thins_paths && with_paths)
            for_each_lane(all, [&](std::size_t i) {
                if (!has_path(b.samples.sample[i])) b.path_lanes &= ~(1u << i);
                p.sample[i] = paths_of(b.samples.sample[i]);
            });
        p.path_lanes = b.path_lanes;
    }
    void count_batch(const SampleBatch& b, const TracedRays& p) {
        count_.samples += b.samples.n;
        ++count_.batches;
        count_.paths += static_cast<std::uint64_t>(std::popcount(b.path_lanes));
        if (f.parts == LightParts::both) {
            count_.met += static_cast<std::uint64_t>(std::popcount(p.hits.met));
            count_.separate += static_cast<std::uint64_t>(std::popcount(p.first.lanes));
        }
        if (++shaded_ % tuning::kBatchesPerClockRead == 0) read_clock();
    }
    /// The centres of 4 x 4 pixels, a whole batch.
    static void put_block(const Tile& tile, int block, std::uint32_t first, int width, SampleBatch& b) {
        const int x = tile.x + block % 2 * kBlock, y = tile.y + block / 2 * kBlock;
        for (int i = 0; i < static_cast<int>(kLanes); ++i) {
            const auto lane = static_cast<std::size_t>(i);
            b.samples.x[lane] = x + i % kBlock, b.samples.y[lane] = y + i / kBlock;
            b.samples.number[lane] =
                first + static_cast<std::uint32_t>(b.samples.y[lane] * width + b.samples.x[lane]);
            b.samples.sample[lane] = 0;
            b.place[lane] = static_cast<std::uint8_t>(block * static_cast<int>(kLanes) + i);
        }
        b.samples.n = kLanes;
    }

    const std::int64_t until_ns_;
    std::atomic<bool>& stop_;  ///< aborts the pass; read often, because a tile may hold many samples
    const std::span<TracedRays> traced_;
    const std::span<SampleBatch> batches_;
    std::size_t full_ = 0;  ///< number of full batches
    PassCount count_;
    std::uint32_t shaded_ = 0;  ///< number of batches shaded so far

    SampleBatch gathered_;
    Lanes<std::uint32_t> gathered_tile_;  ///< of each sample
    std::span<const std::uint32_t> gathered_bodies_;
    GBuffer* gathered_for_ = nullptr;
};

// From a tile's samples to the image.

inline std::size_t index_of(int x, int y, int width) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
}

/// The block of a tile's pixels that starts at (x, y) in the tile.
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
    if (!f.subpixel_bodies.any()) return;
    for (int y = 0; y < t.height; y += kBlock)
        for (int x = 0; x < t.width; x += kBlock)
            add_subpixel_bodies(f, block_of(t, x, y), t.bodies, out, variance);
}

/// Adds the variance of each pixel's mean to `variance`: that of independent samples, block by block, times the
/// tile's VarianceRatio. Pixels without samples add nothing; all others have the same number.
template <class Tile>
void add_variances(const Tile& t, const PerPixel<PixelSamples>& spread, const PerPixel<PixelMeans>& means,
                   PixelMean PixelMeans::*part, int image_width, std::vector<float>& variance) {
    PerPixel<double> independent{};
    std::size_t sampled = 0;
    for (int y = 0; y < t.height; y += kBlock)
        for (int x = 0; x < t.width; x += kBlock) {
            const PixelBlock block = block_of(t, x, y);
            Lanes<std::size_t> place;
            Lanes<PixelSamples> of_block;
            Lanes<double> of_means;
            std::size_t n = 0;
            for (std::size_t i = 0; i < block.n; ++i) {
                place[n] = place_in_tile(block.x[i] - t.x, block.y[i] - t.y);
                of_block[n] = spread[place[n]];
                if (of_block[n].count() > 0) ++n;
            }
            if (n == 0) continue;
            sampled += n;
            variances_of_means(std::span(of_block).first(n), of_means);
            for (std::size_t i = 0; i < n; ++i) independent[place[i]] = of_means[i];
        }
    if (sampled == 0) return;
    VarianceRatio ratio;
    t.each_pixel([&](int, int, std::size_t at) { ratio.add(means[at].*part, independent[at]); });
    constexpr double more = tuning::kPixelsAsIndependent;
    const auto n = static_cast<double>(sampled);
    const bool all = sampled == static_cast<std::size_t>(t.width * t.height);
    const double value = all ? ratio.value() : (n * ratio.value() + more) / (n + more);
    t.each_pixel([&](int x, int y, std::size_t at) {
        variance[index_of(x, y, image_width)] += static_cast<float>(value * independent[at]);
    });
}

/// Sets the variance where pixels have different numbers of samples, or show their centres. `of_paths`: the
/// contrast is that of paths alone.
template <class Tile>
void put_variances(const Tile& t, const PerPixel<PixelMeans>& means, const TileContrast& contrast, bool of_paths,
                   int image_width, std::vector<float>& variance) {
    const auto of_path = [&](std::size_t at) {
        const bool alone = of_paths || means[at].direct.count() == 0;
        return contrast.reused[at] + (alone ? contrast.edge[at] + std::max(contrast.noise[at], 0.0f) : 0);
    };
    const auto of_direct = [&](std::size_t at) {
        return of_paths ? 0.0f : contrast.edge[at] + std::max(contrast.noise[at], 0.0f);
    };
    const auto of_mean = [](const PixelMean& mean, float one) {
        return mean.count() == 0 ? 0 : static_cast<double>(one) / mean.count();
    };
    VarianceRatio ratio_of_direct, ratio_of_path;
    t.each_pixel([&](int, int, std::size_t at) {
        ratio_of_direct.add(means[at].direct, of_mean(means[at].direct, of_direct(at)));
        ratio_of_path.add(means[at].path, of_mean(means[at].path, of_path(at)));
    });
    const double direct = ratio_of_direct.value(), path = ratio_of_path.value();
    // Contrasts do not see anything between the pixels' centres, such as a glint; the steps do.
    const auto at_least = [](const PixelMean& mean, double expected) {
        if (mean.count() < 2) return expected;
        return std::max(expected, static_cast<double>(mean.step()) * static_cast<double>(mean.step()));
    };
    t.each_pixel([&](int x, int y, std::size_t at) {
        const auto& [d, p] = means[at];
        const double sampled =
            at_least(d, direct * of_mean(d, of_direct(at))) + at_least(p, path * of_mean(p, of_path(at)));
        variance[index_of(x, y, image_width)] =
            means[at].count() > 0 ? static_cast<float>(sampled) : contrast.centre[at];
    });
}

inline Rgb radiance_at(const GBufferTile& tile, std::size_t place) {
    return {tile.r[place], tile.g[place], tile.b[place]};
}

/// Prefetches the memory of a tile's pixels.
template <class Tile>
void prefetch_pixels(const Tile& t, const RadianceImage& out) {
    constexpr int kPixelsPerLine = 64 / static_cast<int>(sizeof(Rgb));
    for (int y = 0; y < t.height; ++y)
        for (int x = 0; x < t.width; x += kPixelsPerLine)
            __builtin_prefetch(&out.pixels[index_of(t.x + x, t.y + y, out.width)], 1);
}

/// Four pixels from separate bands, interleaved.
inline std::array<Rgb, kBlock> interleave(const float* red, const float* green, const float* blue) {
    using Four [[gnu::vector_size(16)]] = float;
    static_assert(kBlock == 4 && sizeof(Rgb) == 3 * sizeof(float));
    Four r, g, b;
    std::memcpy(&r, red, sizeof r), std::memcpy(&g, green, sizeof g), std::memcpy(&b, blue, sizeof b);
    const Four low = __builtin_shufflevector(r, g, 0, 4, 1, 5), high = __builtin_shufflevector(r, g, 2, 6, 3, 7);
    const std::array<Four, 3> mixed{
        __builtin_shufflevector(low, b, 0, 1, 4, 2),
        __builtin_shufflevector(__builtin_shufflevector(g, b, 1, 5, 1, 5), high, 0, 1, 4, 5),
        __builtin_shufflevector(high, b, 6, 2, 3, 7)};
    return std::bit_cast<std::array<Rgb, kBlock>>(mixed);
}

/// Writes a tile's pixels, given band by band, to the image.
template <class Tile>
void put_pixels(const Tile& t, const PerPixel<float>& r, const PerPixel<float>& g, const PerPixel<float>& b,
                RadianceImage& out) {
    for (int y = 0; y < t.height; ++y)
        for (int x = 0; x < t.width; x += kBlock) {
            const std::size_t at = place_in_tile(x, y);
            const std::array<Rgb, kBlock> pixels = interleave(&r[at], &g[at], &b[at]);
            Rgb* const to = &out.pixels[index_of(t.x + x, t.y + y, out.width)];
            if (x + kBlock <= t.width)
                std::copy(pixels.begin(), pixels.end(), to);
            else
                std::copy_n(pixels.begin(), t.width - x, to);
        }
}

/// Adds the samples of a batch to their pixels.
inline void add_samples(const SampleBatch& b, const BatchRadiance& light, PerPixel<PixelMeans>& means) {
    const auto add = [&](std::uint32_t lanes, const RgbLanes& part, PixelMean PixelMeans::*to) {
        for_each_lane(lanes, [&](std::size_t i) {
            assert(is_finite(part[i]));
            (means[b.place[i]].*to).add(part[i]);
        });
    };
    add(b.direct_lanes, light.direct, &PixelMeans::direct);
    add(b.path_lanes, light.path, &PixelMeans::path);
}

}  // namespace narpa
