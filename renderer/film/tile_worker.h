/// renderer/film/tile_worker.h - a tile's samples on their way through the renderer: gathered into packets,
/// traced, lit together, handed on. Inside frame_passes.cpp alone.
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <span>

#include "renderer/film/camera_batch.h"
#include "renderer/film/frame_passes.h"

namespace narpa {

/// So many packets go between two looks at the clock.
inline constexpr std::uint32_t kPacketsPerLook = 16;
/// Random numbers of middles that samples may follow: none that a pixel's samples take, as those would not be
/// independent of their own number.
inline constexpr std::uint32_t kFirstMiddle = 0x40000000u;
inline constexpr int kBlock = 4;

/// The first pixel but one stands for the others of a square of `stride`; at the image's edges the last one.
inline bool stands_for(int x, int width, int stride) {
    return stride == 1 || x % stride == 1 || (x % stride == 0 && x == width - 1);
}

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

/// What a thread needs: large, so made once for several tiles.
struct FramePasses::Worker {
    /// Samples that have been traced together.
    struct Batch {
        CameraSamples samples;
        Lanes<std::uint8_t> place;              ///< of each sample's pixel in the tile
        std::uint32_t first = 0, by_paths = 0;  ///< those that count for this part of the light (PacketLight)

        void clear() { samples.n = 0, first = by_paths = 0; }
    };
    /// For packets that are lit together.
    template <std::size_t N>
    struct Room {
        std::array<Packet, N> packets;
        std::array<Batch, N> batches;
    };

    template <std::size_t N>
    Worker(const Frame& frame, const PassLimit& limit, std::atomic<bool>& pass_given_up, Room<N>& room)
        : f(frame),
          until_ns(limit.until_ns),
          given_up(pass_given_up),
          packets(room.packets),
          batches(room.batches) {}

    const Frame& f;
    const std::int64_t until_ns;
    std::atomic<bool>& given_up;  ///< the pass: looked at often, as a tile may hold many samples
    const std::span<Packet> packets;
    const std::span<Batch> batches;
    std::size_t full = 0;                    ///< of these
    std::uint64_t traced = 0, followed = 0;  ///< samples
    std::uint32_t lit = 0;                   ///< packets
    FrameError error;

    [[nodiscard]] std::uint64_t rays_traced(std::uint64_t Packet::*of = &Packet::rays_traced) const {
        std::uint64_t sum = 0;
        for (const Packet& p : packets) sum += p.*of;
        return sum;
    }

    /// For which parts of the light a sample counts.
    struct Counts {
        bool first, by_paths;
    };
    /// `sink(batch, packet, light)` is told of the samples, in order.
    template <class Sink>
    void add(const Tile& tile, int x, int y, std::size_t at, std::uint32_t number, std::uint32_t sample,
             Counts counts, Sink&& sink) {
        Batch& b = batches[full];
        const std::size_t i = b.samples.n++;
        b.first |= static_cast<std::uint32_t>(counts.first) << i;
        b.by_paths |= static_cast<std::uint32_t>(counts.by_paths) << i;
        b.samples.x[i] = x, b.samples.y[i] = y;
        b.samples.number[i] = number, b.samples.sample[i] = sample;
        b.place[i] = static_cast<std::uint8_t>(at);
        if (b.samples.n < kLanes) return;
        trace(tile);
        if (full == packets.size()) light(sink);
    }
    void trace(const Tile& tile) {
        Batch& b = batches[full];
        if (given_up.load(std::memory_order_relaxed)) b.clear();
        if (b.samples.n == 0) return;
        trace_rays(f, b.samples, tile.bodies, packets[full]);
        packets[full].by_paths = b.by_paths;
        ++full;
    }
    template <class Sink>
    void light(Sink&& sink) {
        std::array<PacketLight, kTogether> lights;
        if (full > 0) f.integrator.radiance(f, packets.first(full), lights);
        for (std::size_t k = 0; k < full; ++k) {
            sink(batches[k], packets[k], lights[k]);
            traced += batches[k].samples.n;
            followed += static_cast<std::uint64_t>(std::popcount(batches[k].by_paths));
            batches[k].clear();
            if (++lit % kPacketsPerLook == 0) look_at_clock();
        }
        full = 0;
    }
    /// The samples that are left.
    template <class Sink>
    void finish(const Tile& tile, Sink&& sink) {
        trace(tile);
        light(sink);
    }
    void begin(bool middles) {
        for (Batch& b : batches) b.samples.middle = middles;
    }
    void look_at_clock() {
        if (until_ns != PassLimit{}.until_ns && now_ns() >= until_ns)
            given_up.store(true, std::memory_order_relaxed);
    }
    void middles(const Tile& tile, int width, int height, int stride, int made, GBuffer& looks) {
        middles(tile, width, height, stride, made, [&](const Batch& b, const Packet& p, const PacketLight& light_) {
            looks.store(f, p, light_, b.place, tile.index);
        });
    }
    template <class Store>
    void middles(const Tile& tile, int width, int height, int stride, int made, Store&& store) {
        begin(true);
        const std::uint32_t first = f.settings.budget.kind == FrameBudget::Kind::samples ? 0 : kFirstMiddle;
        if (stride == 1 && made == 0 && tile.whole()) {
            for (int block = 0; block < 4; ++block) {
                put_block(tile, block, first, width, batches[full]);
                trace(tile);
                if (full == packets.size()) light(store);
            }
            light(store);
            return;
        }
        tile.each_pixel([&](int x, int y, std::size_t at) {
            if (!stands_for(x, width, stride) || !stands_for(y, height, stride)) return;
            if (made > 0 && stands_for(x, width, made) && stands_for(y, height, made)) return;
            add(tile, x, y, at, first + static_cast<std::uint32_t>(y * width + x), 0, {true, true}, store);
        });
        finish(tile, store);
    }

private:
    /// The middles of 4 x 4 pixels, a whole packet.
    static void put_block(const Tile& tile, int block, std::uint32_t first, int width, Batch& b) {
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
        b.first = b.by_paths = lanes_below(kLanes);
    }
};

}  // namespace narpa
