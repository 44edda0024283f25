#include "renderer/integrator/path_integrator.h"

#include <array>
#include <limits>

#include "renderer/integrator/sun_direct_lighting.h"

namespace narpa {
namespace {

/// Each ray by itself: of lanes `lanes` of one batch.
void trace_paths(const Frame& f, Packet& p, std::uint32_t lanes, RgbLanes& radiance) {
    PhaseClock clock(p.times);
    Lanes<Ray> rays;
    Lanes<Hit> hits;
    Lanes<Rgb> light;
    Lanes<std::uint32_t> number, sample;
    std::size_t n = 0;
    for_each_lane(lanes, [&](std::size_t i) {
        rays[n] = p.rays[i], hits[n] = p.hits[i];
        number[n] = p.number[i], sample[n++] = p.sample[i];
    });
    p.rays_traced +=
        path_radiance(f.render_scene, f.at, f.path, std::span(rays).first(n), std::span(hits).first(n),
                      {f.settings.seed, f.settings.frame, std::span(number).first(n), std::span(sample).first(n)},
                      std::span(light).first(n));
    n = 0;
    for_each_lane(lanes, [&](std::size_t i) { radiance.put(i, light[n++]); });
    clock.ends(Phase::indirect);
}

/// A sample of a pixel.
struct SamplePlace {
    std::uint8_t packet, lane;
};

/// One sample of each of some pixels, with path reuse.
void trace_reused(const Frame& f, std::span<Packet> packets, std::span<const SamplePlace> places,
                  std::span<PacketLight> light) {
    std::array<SamplePlace, kReuseGroup> from;
    std::array<PathStart, kReuseGroup> starts;
    std::array<Rgb, kReuseGroup> radiance;
    std::array<float, kReuseGroup> variance;
    std::size_t n = 0;
    // As on a chessboard, first one colour, then the other: those of a group lie between those of another.
    for (std::size_t colour = 0; colour < 2; ++colour)
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (((i ^ i >> 2) & 1) != colour) continue;
            const auto [packet, lane] = places[i];
            const Packet& p = packets[packet];
            if (f.sun_first && !is_set(p.hits.met, lane)) continue;
            from[n] = places[i];
            const bool sunlit = light[packet].first[lane] != Rgb{};
            starts[n++] = {&p.rays, &p.hits, &p.first, lane, p.number[lane], p.sample[lane], sunlit};
        }
    const std::uint64_t rays =
        reused_path_radiance(f.render_scene, f.at, f.path, std::span(starts).first(n), f.settings.seed,
                             f.settings.frame, std::span(radiance).first(n), std::span(variance).first(n));
    packets.front().rays_traced += rays;
    packets.front().path_rays += rays;
    for (std::size_t i = 0; i < n; ++i) {
        light[from[i].packet].by_paths.put(from[i].lane, radiance[i]);
        packets[from[i].packet].variance[from[i].lane] = variance[i];
    }
}

}  // namespace

void DirectIntegrator::radiance(const Frame& f, Packet& p, RgbLanes& radiance) const noexcept {
    trace_paths(f, p, lanes_below(p.rays.n), radiance);
}
void DirectIntegrator::radiance(const Frame& f, std::span<Packet> packets,
                                std::span<PacketLight> light) const noexcept {
    for (std::size_t k = 0; k < packets.size(); ++k) {
        light[k].first.fill({});
        light[k].by_paths.fill({});
        packets[k].variance.fill(0);
        trace_paths(f, packets[k], packets[k].by_paths & lanes_below(packets[k].rays.n), light[k].by_paths);
    }
}

void PathIntegrator::radiance(const Frame& f, Packet& p, RgbLanes& radiance) const noexcept {
    trace_paths(f, p, lanes_below(p.rays.n), radiance);
}
void PathIntegrator::radiance(const Frame& f, std::span<Packet> packets,
                              std::span<PacketLight> light) const noexcept {
    for (std::size_t k = 0; k < packets.size(); ++k) {
        Packet& p = packets[k];
        p.lit = p.first.lanes = 0;
        light[k].first.fill({});
        light[k].by_paths.fill({});
        p.variance.fill(0);
        if (!f.sun_first) continue;
        if (p.hits.met != 0) light_first_surfaces(f, p, light[k].first);
        for_each_lane(lanes_below(p.rays.n) & ~p.hits.met, [&](std::size_t i) {
            light[k].first.put(i, escaped_radiance(f.render_scene, p.rays.direction[i]));
        });
    }
    if (packets.empty()) return;
    PhaseClock clock(packets.front().times);
    // One sample of each pixel together, then the next of each: those of a pixel stay independent.
    std::array<std::array<SamplePlace, kReuseGroup>, kOfAPixel> places;
    std::array<std::size_t, kOfAPixel> n{};
    std::size_t rank = 0;
    std::uint32_t pixel = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t k = 0; k < packets.size(); ++k)
        for_each_lane(packets[k].by_paths & lanes_below(packets[k].rays.n), [&](std::size_t i) {
            rank = packets[k].number[i] == pixel ? rank + 1 : 0;
            pixel = packets[k].number[i];
            places[rank][n[rank]++] = {static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(i)};
        });
    for (std::size_t r = 0; r < kOfAPixel && n[r] > 0; ++r)
        trace_reused(f, packets, std::span(places[r]).first(n[r]), light);
    clock.ends(Phase::indirect);
}

}  // namespace narpa
