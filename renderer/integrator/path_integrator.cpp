#include <algorithm>
#include <array>
#include <limits>
#include <new>

#include "base/uninitialized_array.h"
#include "renderer/integrator/integrator.h"

namespace narpa {
namespace {

/// Batches whose paths are traced together.
constexpr std::size_t kTogether = 8;

/// Traces each ray on its own, for up to kTogether batches and the lanes that `lanes` gives for a batch.
/// `put(batch, lane, radiance)` takes the results.
template <class LanesOf, class Put>
void trace_paths(const Frame& f, std::span<CameraBatch> batches, LanesOf&& lanes, Put&& put) {
    PhaseClock clock(batches.front().times);
    UninitializedArray<Ray, kTogether * kLanes> rays;
    UninitializedArray<Hit, kTogether * kLanes> hits;
    UninitializedArray<Rgb, kTogether * kLanes> light;
    std::array<std::uint32_t, kTogether * kLanes> number, sample;
    std::size_t n = 0;
    for (const CameraBatch& p : batches)
        for_each_lane(lanes(p), [&](std::size_t i) {
            // Constructed in place: a copy would stall on store forwarding from the partial writes.
            new (&rays[n]) Ray(p.rays[i]);
            new (&hits[n]) Hit(p.hits[i]);
            number[n] = p.number[i], sample[n++] = p.sample[i];
        });
    batches.front().rays_traced +=
        path_radiance(f.render_scene, f.at, f.path, rays.first(n), hits.first(n),
                      {f.settings.seed, f.settings.frame, std::span(number).first(n), std::span(sample).first(n)},
                      light.first(n));
    n = 0;
    for (std::size_t k = 0; k < batches.size(); ++k)
        for_each_lane(lanes(batches[k]), [&](std::size_t i) { put(k, i, light[n++]); });
    clock.ends(Phase::indirect);
}

/// Position of a sample in the batches.
struct SamplePlace {
    std::uint8_t batch, lane;
};

/// Traces one sample of each of some pixels, with path reuse.
void trace_reused(const Frame& f, std::span<CameraBatch> batches, std::span<const SamplePlace> places,
                  std::span<BatchRadiance> light) {
    std::array<SamplePlace, kReuseGroup> from;
    std::array<PathStart, kReuseGroup> starts;
    std::array<Rgb, kReuseGroup> radiance;
    std::array<float, kReuseGroup> variance;
    std::size_t n = 0;
    // In checkerboard order, so that the pixels of one reuse group lie between those of another.
    for (std::size_t colour = 0; colour < 2; ++colour)
        for (std::size_t i = 0; i < places.size(); ++i) {
            if (((i ^ i >> 2) & 1) != colour) continue;
            const auto [batch, lane] = places[i];
            const CameraBatch& p = batches[batch];
            if (f.separate_sun && !is_set(p.hits.met, lane)) continue;
            from[n] = places[i];
            const bool sunlit = light[batch].direct[lane] != Rgb{};
            starts[n++] = {&p.rays, &p.hits, &p.first, lane, p.number[lane], p.sample[lane], sunlit};
        }
    const std::uint64_t rays =
        reused_path_radiance(f.render_scene, f.at, f.path, std::span(starts).first(n), f.settings.seed,
                             f.settings.frame, std::span(radiance).first(n), std::span(variance).first(n));
    batches.front().rays_traced += rays;
    batches.front().path_rays += rays;
    for (std::size_t i = 0; i < n; ++i) {
        light[from[i].batch].path.put(from[i].lane, radiance[i]);
        batches[from[i].batch].variance[from[i].lane] = variance[i];
    }
}

}  // namespace

void DirectIntegrator::radiance(const Frame& f, CameraBatch& p, RgbLanes& radiance) const noexcept {
    trace_paths(
        f, std::span(&p, 1), [](const CameraBatch& batch) { return lanes_below(batch.rays.n); },
        [&](std::size_t, std::size_t i, const Rgb& light) { radiance.put(i, light); });
}
void DirectIntegrator::radiance(const Frame& f, std::span<CameraBatch> batches,
                                std::span<BatchRadiance> light) const noexcept {
    for (std::size_t k = 0; k < batches.size(); ++k) {
        light[k].direct.fill({});
        light[k].path.fill({});
        batches[k].variance.fill(0);
    }
    for (std::size_t first = 0; first < batches.size(); first += kTogether)
        trace_paths(
            f, batches.subspan(first, std::min(kTogether, batches.size() - first)),
            [](const CameraBatch& batch) { return batch.path_lanes & lanes_below(batch.rays.n); },
            [&](std::size_t k, std::size_t i, const Rgb& r) { light[first + k].path.put(i, r); });
}

void PathIntegrator::radiance(const Frame& f, std::span<CameraBatch> batches,
                              std::span<BatchRadiance> light) const noexcept {
    for (std::size_t k = 0; k < batches.size(); ++k) {
        CameraBatch& p = batches[k];
        p.lit = p.first.lanes = 0;
        light[k].direct.fill({});
        light[k].path.fill({});
        p.variance.fill(0);
        if (!f.separate_sun) continue;
        if (p.hits.met != 0) add_first_hit_sunlight(f, p, light[k].direct);
        for_each_lane(lanes_below(p.rays.n) & ~p.hits.met, [&](std::size_t i) {
            light[k].direct.put(i, escaped_radiance(f.render_scene, p.rays.direction[i]));
        });
    }
    if (batches.empty()) return;
    PhaseClock clock(batches.front().times);
    // One sample of each pixel together, then the next of each, so that the samples of a pixel stay independent.
    std::array<std::array<SamplePlace, kReuseGroup>, kMaxPixelSamples> places;
    std::array<std::size_t, kMaxPixelSamples> n{};
    std::size_t rank = 0;
    std::uint32_t pixel = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t k = 0; k < batches.size(); ++k)
        for_each_lane(batches[k].path_lanes & lanes_below(batches[k].rays.n), [&](std::size_t i) {
            rank = batches[k].number[i] == pixel ? rank + 1 : 0;
            pixel = batches[k].number[i];
            places[rank][n[rank]++] = {static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(i)};
        });
    for (std::size_t r = 0; r < kMaxPixelSamples && n[r] > 0; ++r)
        trace_reused(f, batches, std::span(places[r]).first(n[r]), light);
    clock.ends(Phase::indirect);
}

}  // namespace narpa
