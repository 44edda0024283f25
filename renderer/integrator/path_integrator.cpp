#include "renderer/integrator/path_integrator.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <limits>
#include <variant>

#include "base/constants.h"
#include "base/uninitialized_array.h"
#include "renderer/integrator/shading.h"
#include "renderer/integrator/sun_direct_lighting.h"

namespace narpa {
namespace {

/// Batches whose paths are traced together.
constexpr std::size_t kTogether = 8;

/// Traces each ray on its own, for up to kTogether batches and the lanes that `lanes` gives for a batch.
/// `put(batch, lane, radiance)` takes the results.
template <class LanesOf, class Put>
void trace_paths(const Transport& t, std::span<TracedRays> batches, LanesOf&& lanes, Put&& put) {
    PhaseClock clock(batches.front().times);
    std::array<PathStart, kTogether * kLanes> starts;
    UninitializedArray<Rgb, kTogether * kLanes> light;
    std::size_t n = 0;
    for (const TracedRays& p : batches)
        for_each_lane(lanes(p), [&](std::size_t i) {
            starts[n++] = {&p.rays, &p.hits, nullptr, i, p.number[i], p.sample[i]};
        });
    batches.front().rays_traced += path_radiance(t, std::span(starts).first(n), light.first(n));
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
void trace_reused(const Transport& t, std::span<TracedRays> batches, std::span<const SamplePlace> places,
                  bool emission_known, std::span<BatchRadiance> light) {
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
            const TracedRays& p = batches[batch];
            if (is_set(p.complete, lane)) continue;
            from[n] = places[i];
            const bool sunlit = is_set(p.first.lanes, lane) && light[batch].direct[lane] != Rgb{};
            starts[n++] = {&p.rays,        &p.hits,        &p.first, lane,
                           p.number[lane], p.sample[lane], sunlit,   emission_known};
        }
    const std::uint64_t rays = reused_path_radiance(t, std::span(starts).first(n), std::span(radiance).first(n),
                                                    std::span(variance).first(n));
    batches.front().rays_traced += rays;
    batches.front().path_rays += rays;
    for (std::size_t i = 0; i < n; ++i) {
        light[from[i].batch].path.put(from[i].lane, radiance[i]);
        batches[from[i].batch].variance[from[i].lane] = variance[i];
    }
}

/// The same for all samples: one sample of each pixel together, then the next of each, so that the samples of a
/// pixel stay independent.
void trace_all_reused(const Transport& t, std::span<TracedRays> batches, bool emission_known,
                      std::span<BatchRadiance> light) {
    if (batches.empty()) return;
    PhaseClock clock(batches.front().times);
    for (std::size_t k = 0; k < batches.size(); ++k) {
        light[k].path.fill({});
        batches[k].variance.fill(0);
    }
    std::array<std::array<SamplePlace, kReuseGroup>, kMaxPixelSamples> places;
    std::array<std::size_t, kMaxPixelSamples> n{};
    std::size_t rank = 0;
    std::uint32_t pixel = std::numeric_limits<std::uint32_t>::max();
    for (std::size_t k = 0; k < batches.size(); ++k)
        for_each_lane(batches[k].path_lanes & lanes_below(batches[k].rays.n), [&](std::size_t i) {
            rank = batches[k].number[i] == pixel ? rank + 1 : 0;
            pixel = batches[k].number[i];
            assert(rank < kMaxPixelSamples && n[rank] < kReuseGroup);
            places[rank][n[rank]++] = {static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(i)};
        });
    for (std::size_t r = 0; r < kMaxPixelSamples && n[r] > 0; ++r)
        trace_reused(t, batches, std::span(places[r]).first(n[r]), emission_known, light);
    clock.ends(Phase::indirect);
}

void trace_each(const Transport& t, TracedRays& p, RgbLanes& radiance) {
    trace_paths(
        t, std::span(&p, 1), [](const TracedRays& batch) { return lanes_below(batch.rays.n); },
        [&](std::size_t, std::size_t i, const Rgb& light) { radiance.put(i, light); });
}

/// Radiance along a camera ray that escapes, without a medium: the background and the Sun's disc.
Rgb escaped_radiance(const RenderScene& render_scene, const Vec3& direction) noexcept {
    const Rgb background = render_scene.background().radiance(direction);
    const std::optional<SunDisc>& sun = render_scene.lights().sun();
    if (!sun || sun->is_point() || sun->pdf(direction) == 0) return background;
    return background + Rgb{sun->radiance(), sun->radiance(), sun->radiance()};
}

/// Light that a camera ray meets itself, without a medium: of the surface, of lights before it, or of the
/// background.
Rgb met_emission(const Transport& t, const TracedRays& p, std::size_t i) noexcept {
    const bool met = is_set(p.hits.met, i);
    Rgb sum{};
    if (const Lights& lights = t.render_scene.lights(); lights.any_with_extent()) {
        const Receiver from{.anchor = p.rays.origin[i], .time = p.rays.time[i]};
        sum = lights.radiance_before(met ? p.hits.range_m[i] : kInfinity, t.at, from, Lights::Group::all,
                                     p.rays.direction[i], kInfinity, nullptr);
    }
    if (!met) return sum + escaped_radiance(t.render_scene, p.rays.direction[i]);
    const Material& m = t.render_scene.scene().materials[static_cast<std::size_t>(p.hits.material[i])];
    if (m.emission == Rgb{}) return sum;
    if (!has_emission_map(m)) return sum + m.emission;
    const double width_m = t.path.pixel_angle_rad * p.hits.range_m[i];
    return sum + surface_at(t.render_scene.tracer(), t.at, p.hits[i], p.rays.direction[i], width_m).emission;
}

}  // namespace

void DirectLighting::radiance(const Transport& t, TracedRays& p, RgbLanes& radiance) const noexcept {
    trace_each(t, p, radiance);
}
void DirectLighting::radiance(const Transport& t, std::span<TracedRays> batches,
                              std::span<BatchRadiance> light) const noexcept {
    assert(t.path.direct && batches.size() <= light.size());
    for (TracedRays& p : batches) p.variance.fill(0);
    for (std::size_t first = 0; first < batches.size(); first += kTogether)
        trace_paths(
            t, batches.subspan(first, std::min(kTogether, batches.size() - first)),
            [](const TracedRays& batch) { return batch.path_lanes & lanes_below(batch.rays.n); },
            [&](std::size_t k, std::size_t i, const Rgb& r) { light[first + k].path.put(i, r); });
}

void PathIntegrator::radiance(const Transport& t, TracedRays& p, RgbLanes& radiance) const noexcept {
    trace_each(t, p, radiance);
}
void PathIntegrator::radiance(const Transport& t, std::span<TracedRays> batches,
                              std::span<BatchRadiance> light) const noexcept {
    assert(!t.path.direct && batches.size() <= kMaxBatches && batches.size() <= light.size());
    for (TracedRays& p : batches) p.first.lanes = p.complete = 0;
    trace_all_reused(t, batches, false, light);
}

bool SunPathIntegrator::suffices(const RenderScene& render_scene) noexcept {
    const Lights& lights = render_scene.lights();
    if (lights.any(Lights::Group::all) || lights.any_with_extent() || !lights.sun()) return false;
    if (render_scene.medium() != nullptr || render_scene.background().is_sampled()) return false;
    const Scene& scene = render_scene.scene();
    const auto is_flat = [&](const Body& b) {
        const int* const mesh = std::get_if<int>(&b.shape);
        return mesh == nullptr || scene.meshes[static_cast<std::size_t>(*mesh)].normals.empty();
    };
    if (std::ranges::none_of(scene.bodies, is_flat)) return false;
    return lights.sun()->is_point() || scene.sun->angular_diameter_rad < kNarrowSun_rad;
}

void SunPathIntegrator::radiance(const Transport& t, std::span<TracedRays> batches,
                                 std::span<BatchRadiance> light) const noexcept {
    assert(!t.path.direct && batches.size() <= kMaxBatches && batches.size() <= light.size());
    for (std::size_t k = 0; k < batches.size(); ++k) {
        TracedRays& p = batches[k];
        p.lit = p.first.lanes = 0;
        p.complete = ~p.hits.met;
        light[k].direct.fill({});
        if (p.hits.met != 0) add_first_hit_sunlight(t, p, light[k].direct);
        for_each_lane(lanes_below(p.rays.n) & ~p.hits.met, [&](std::size_t i) {
            light[k].direct.put(i, escaped_radiance(t.render_scene, p.rays.direction[i]));
        });
    }
    trace_all_reused(t, batches, false, light);
}

bool EmissionPathIntegrator::suffices(const RenderScene& render_scene) noexcept {
    return render_scene.lights().any_visible() && render_scene.medium() == nullptr;
}

void EmissionPathIntegrator::radiance(const Transport& t, std::span<TracedRays> batches,
                                      std::span<BatchRadiance> light) const noexcept {
    assert(!t.path.direct && batches.size() <= kMaxBatches && batches.size() <= light.size());
    for (std::size_t k = 0; k < batches.size(); ++k) {
        TracedRays& p = batches[k];
        p.lit = p.first.lanes = 0;
        p.complete = ~p.hits.met;
        light[k].direct.fill({});
        for_each_lane(lanes_below(p.rays.n), [&](std::size_t i) { light[k].direct.put(i, met_emission(t, p, i)); });
    }
    trace_all_reused(t, batches, true, light);
}

}  // namespace narpa
