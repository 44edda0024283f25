#include "renderer/integrator/wavefront.h"

#include <algorithm>
#include <cassert>
#include <new>
#include <type_traits>

#include "base/constants.h"
#include "base/each_isa.h"

namespace narpa {
namespace {

/// Russian roulette: a path whose throughput is below kFaint may end; one that has found no light yet, as on night
/// sides, only below kFaintUnlit and after kUnlitVertices vertices.
constexpr float kFaint = 0.5f, kFaintUnlit = 0.25f;
constexpr int kUnlitVertices = 4;

NARPA_EACH_ISA void draw_points(const Transport& t, std::size_t n, const Lanes<std::uint32_t>& pixel,
                                const Lanes<std::uint32_t>& sample, std::uint32_t group,
                                BatchSampler::Points& u) noexcept {
    BatchSampler(t.seed, t.frame, n, pixel, sample).points(group, u);
}

/// Assigns what `make` returns, without a temporary: storing that in parts and loading it whole would stall store
/// forwarding.
template <class T>
void assign(T& to, const auto& make) {
    static_assert(std::is_trivially_destructible_v<T>);
    ::new (&to) T(make());
}

}  // namespace

Wavefront::Wavefront(const Transport& t)
    : render_scene_(t.render_scene),
      tracer_(t.render_scene.tracer()),
      lights_(t.render_scene.lights()),
      background_(t.render_scene.background()),
      medium_(t.render_scene.medium()),
      at_(t.at),
      settings_(t.path),
      transport_(t),
      group_(t.path.direct ? Lights::Group::lights : Lights::Group::all),
      sun_(lights_.sun() ? &*lights_.sun() : nullptr),
      sun_has_extent_(sun_ != nullptr && !sun_->is_point()),
      narrow_sun_(sun_ != nullptr && t.render_scene.scene().sun->angular_diameter_rad < kNarrowSun_rad),
      small_bodies_(t.path.small_bodies && sun_ != nullptr && !t.path.direct),
      emitters_(lights_.any(group_)),
      background_sampled_(background_.is_sampled() && !t.path.direct),
      receivers_(emitters_ || lights_.any_with_extent() || small_bodies_ || medium_ != nullptr),
      finds_alone_(background_.uniform() != Rgb{} || (sun_has_extent_ && !narrow_sun_)),
      sun_alone_(!lights_.any(Lights::Group::all) && !lights_.any_with_extent() && background_.uniform() == Rgb{} &&
                 medium_ == nullptr) {}

void Wavefront::run(std::span<const PathStart> starts, std::span<Rgb> radiance) {
    assert(starts.size() <= kWavefront);
    starts_ = starts;
    radiance_ = radiance;
    begin();
    run_rounds();
}

void Wavefront::run_reused(std::span<const PathStart> starts, std::span<Rgb> radiance, std::span<float> variance) {
    grouped_ = !settings_.direct && settings_.max_depth > 1;
    // A medium would absorb light between the connected vertices.
    reuse_ = grouped_ && settings_.reuse && medium_ == nullptr;
    starts_ = starts;
    radiance_ = radiance;
    variance_ = variance;
    std::fill(variance.begin(), variance.end(), 0.0f);
    first_.clear();
    begin();
    run_rounds();
}

void Wavefront::run_rounds() {
    const int depth = settings_.direct ? 1 : settings_.max_depth;
    for (int vertex = 0;; ++vertex) {
        arrive(vertex);
        if (vertex == 1 && grouped_) collect_second_vertices();
        if (vertex == depth || n_ == 0) break;
        connect(vertex, vertex + 1 < depth);
        if (settings_.direct && !lights_.any_with_extent()) return;
        scatter(vertex, vertex + 1 == depth);
        extend();
    }
    if (n_second_ > 0) reuse();
}

void Wavefront::extend() {
    for (std::size_t first = 0; first < n_; first += kLanes) {
        const std::size_t n = std::min(kLanes, n_ - first);
        SurfacePoints from;
        Vec3Lanes directions;
        HitBatch hits;
        for (std::size_t k = 0; k < n; ++k) {
            from.put(k, hits_[first + k]);
            directions.put(k, directions_[first + k]);
        }
        hits.met = 0;
        tracer_.intersect(at_, from, directions, lanes_below(n), hits);
        for (std::size_t k = 0; k < n; ++k) {
            if (is_set(hits.met, k))
                assign(hits_[first + k], [&] { return hits[k]; });
            else
                hits_[first + k].body = -1;
        }
        rays_traced_ += n;
    }
}

/// Adds the light that the rays found; removes paths that escaped or end here.
void Wavefront::arrive(int vertex) {
    // Method "direct": rays beyond the first surface only look for area lights; the in-scattering that surfaces
    // receive is in `ambient`.
    const bool in_medium = medium_ != nullptr && !(vertex > 0 && settings_.direct);
    if (in_medium) find_segments(vertex);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        Path& path = paths_[i];
        const bool is_escaped = hits_[i].body < 0;
        const double range_m = is_escaped ? kInfinity : hits_[i].range_m;
        const bool known = vertex == 0 && starts_[path.ray].emission_known;
        if (lights_.any_with_extent() && !known)
            add(path, lights_.radiance_before(range_m, at_, path.start, group_, directions_[i], path.direction_pdf,
                                              medium_));
        if (in_medium) {
            add(path, segments_[i].in_scattering);
            path.throughput = path.throughput * segments_[i].transmittance;
        }
        if (is_escaped && !known) add(path, escaped(path, directions_[i], vertex));
        if (is_escaped || (vertex > 0 && settings_.direct)) continue;
        keep(i, kept);
        shade(kept++, !known);
    }
    n_ = kept;
}

/// Computes the medium's effect along the rays.
void Wavefront::find_segments(int vertex) {
    UninitializedArray<MediumRay, kWavefront> rays;
    for (std::size_t i = 0; i < n_; ++i) {
        const Path& path = paths_[i];
        rays[i] = {{path.start.anchor + path.start.offset, directions_[i], path.start.time},
                   hits_[i].body < 0 ? kInfinity : hits_[i].range_m};
        if (!medium_->uses_random_numbers()) continue;
        const PathStart& start = starts_[path.ray];
        rays[i].u = sampler(start).point(start.sample, medium_group(vertex))[0];
    }
    medium_->along_each(at_, rays.first(n_), segments_.first(n_));
}

Rgb Wavefront::escaped(const Path& path, const Vec3& direction, int vertex) const {
    if (settings_.direct) return vertex == 0 ? background_.direct_radiance(direction) : Rgb{};
    Rgb radiance = background_.radiance(direction);
    if (background_sampled_)
        radiance *= static_cast<float>(power_heuristic(path.direction_pdf, background_.pdf(direction)));
    if (!sun_has_extent_ || path.sun_sampled) return radiance;
    const double sun_pdf = sun_->pdf(direction);
    if (sun_pdf == 0) return radiance;
    const float sunlight = static_cast<float>(power_heuristic(path.direction_pdf, sun_pdf)) * sun_->radiance();
    return radiance + Rgb{sunlight, sunlight, sunlight};
}

/// Makes the vertex at the hit, and adds its emission if that counts.
void Wavefront::shade(std::size_t i, bool emission_counts) {
    Path& path = paths_[i];
    const Hit& hit = hits_[i];
    path.length_m += hit.range_m;
    assign(vertices_[i], [&] {
        const double width_m = settings_.pixel_angle_rad * path.length_m;
        return PathVertex(tracer_, at_, hit, directions_[i], width_m, !settings_.direct);
    });
    const Surface& surface = vertices_[i].surface();
    if (surface.emission != Rgb{} && !path.lit && emission_counts) {
        const double light_pdf =
            path.direction_pdf == kInfinity ? 0 : lights_.pdf(at_, path.start, group_, directions_[i], hit);
        add(path, surface.emission * static_cast<float>(power_heuristic(path.direction_pdf, light_pdf)));
    }
    if (settings_.direct) add(path, ambient(i) * ambient_reflectance(surface));
    if (receivers_) path.start = receiver_at(at_, hit, vertices_[i].plane());
}

/// Method "direct": ambient light at a vertex.
Rgb Wavefront::ambient(std::size_t i) const {
    if (medium_ == nullptr) return background_.ambient();
    const Hit& hit = hits_[i];
    return background_.ambient() + medium_->ambient(at_, hit.position, vertices_[i].surface().normal, hit.time);
}

/// Chooses the next rays, and ends paths that would contribute little or nothing.
void Wavefront::scatter(int vertex, bool last) {
    std::size_t kept = 0;
    Points u, roulette;
    for (std::size_t first = 0; first < n_; first += kLanes) {
        bool drawn = false;
        draw(first, direction_group(vertex), u);
        for (std::size_t k = 0; k < kLanes && first + k < n_; ++k) {
            const std::size_t i = first + k;
            Path& path = paths_[i];
            if (last && sun_alone_ && path.sun_sampled) continue;
            float inverse_survival = 1;
            const auto survives = [&](float probability) {
                if (probability >= 1) return true;
                if (!drawn) draw(first, roulette_group(vertex), roulette);
                drawn = true;
                if (roulette[roulette_dimension(vertex)][k] >= static_cast<double>(probability)) return false;
                inverse_survival = 1 / probability;
                path.throughput = path.throughput / probability;
                return true;
            };
            const bool is_first = vertex == 0 && grouped_ && !vertices_[i].specular();
            if (is_first && !path.lit) {
                const Surface& surface = vertices_[i].surface();
                const bool plain = is_lambert_or_phong(*surface.material);
                const float probability = first_survival(plain ? surface.diffuse + surface.specular : Rgb{1, 1, 1},
                                                         radiance_[path.ray] == Rgb{});
                if (reuse_) path.first_vertex = first_.add(at_, hits_[i], vertices_[i], path, probability);
                if (!survives(probability)) continue;
            }
            const BsdfSample s = next_direction(i, {u[0][k], u[1][k], u[2][k], u[3][k]});
            path.throughput = path.throughput * s.weight;
            path.radiance_scale *= s.radiance_scale;
            // The throughput may overflow single precision after leaving many nested shells of dense glass.
            if (path.throughput == Rgb{} || !is_finite(path.throughput)) continue;
            if (!is_first && !survives(survival(path, vertex + 1))) continue;
            if (SecondVertex* const second = second_vertex(path, vertex);
                second != nullptr && !second->leave(path, s, inverse_survival))
                continue;
            path.direction_pdf = s.pdf;
            directions_[i] = s.l;
            if (s.transmitted) {
                hits_[i] = other_side(hits_[i]);
                if (receivers_) path.start = receiver_at(at_, hits_[i], -vertices_[i].plane());
            }
            keep(i, kept++);
        }
    }
    n_ = kept;
}

BsdfSample Wavefront::next_direction(std::size_t i, const SamplePoint& numbers) const {
    const auto& [u, v, lobe, choice] = numbers;
    const Path& path = paths_[i];
    const double share = path.small_bodies.share();
    if (share == 0) return vertices_[i].scatter({lobe, u, v});
    BsdfSample s;
    if (choice < share)
        s.l = path.small_bodies.direction(tracer_, at_, path.start, choice / share, u, v);
    else if (s = vertices_[i].scatter({lobe, u, v}); s.weight == Rgb{})
        return s;  // below the surface; `respond` counts only directions above it
    const PathVertex::Response r = vertices_[i].respond(s.l);
    s.pdf = scatter_pdf(path, s.l, r.pdf);
    s.weight = r.f_cos == Rgb{} ? Rgb{} : r.f_cos * static_cast<float>(1 / s.pdf);
    return s;
}

/// Density per solid angle of `next_direction` for a direction that the BSDF alone chooses with `bsdf_pdf`.
double Wavefront::scatter_pdf(const Path& path, const Vec3& direction, double bsdf_pdf) const {
    const double share = path.small_bodies.share();
    if (share == 0) return bsdf_pdf;
    return (1 - share) * bsdf_pdf + share * path.small_bodies.pdf(tracer_, at_, path.start, direction);
}

/// Probability that a path survives the roulette after this many vertices.
float Wavefront::survival(const Path& path, int vertices) const {
    // A wide Sun is sampled by two techniques, weighted by MIS: roulette would make one of them noisy.
    const bool nothing_yet = radiance_[path.ray] == Rgb{} && !path.sunlit;
    const bool unlit = nothing_yet || (sun_has_extent_ && !narrow_sun_);
    if (unlit && vertices < kUnlitVertices) return 1;
    return std::min(1.0f, max_component(path.throughput) / path.radiance_scale / (unlit ? kFaintUnlit : kFaint));
}
/// The same for a reused path at its first vertex, before the direction is known.
float Wavefront::first_survival(const Rgb& albedo, bool unlit) const {
    if (finds_alone_) return 1;
    return settings_.first_survival * std::min(1.0f, max_component(albedo) / (unlit ? kFaintUnlit : kFaint));
}

/// Makes the paths. A reused one passes the roulette of its first vertex here if the direct light there is known.
void Wavefront::begin() {
    n_ = 0;
    for (std::size_t from = 0; from < starts_.size(); from += kLanes) {
        const std::span<const PathStart> batch = starts_.subspan(from, std::min(kLanes, starts_.size() - from));
        Points roulette;
        if (grouped_ && !finds_alone_) {
            Lanes<std::uint32_t> pixel{}, sample{};
            for (std::size_t k = 0; k < batch.size(); ++k) pixel[k] = batch[k].pixel, sample[k] = batch[k].sample;
            draw_points(transport_, batch.size(), pixel, sample, roulette_group(0), roulette);
        }
        for (std::size_t k = 0; k < batch.size(); ++k) {
            const std::size_t ray = from + k;
            const PathStart& s = batch[k];
            radiance_[ray] = {};
            Path& path = paths_[n_];
            path = Path{};
            path.ray = static_cast<std::uint32_t>(ray);
            path.to = &radiance_[ray];
            if (s.lit()) {
                if (!grouped_) continue;
                if (small_bodies_ && !s.sunlit) sample_small_bodies(path, s);
                const Rgb albedo = s.surfaces->diffuse[s.lane] + s.surfaces->specular[s.lane];
                const float probability = first_survival(albedo, !s.sunlit);
                if (reuse_) path.first_vertex = first_.add(at_, s, path, probability);
                if (probability < 1 && roulette[roulette_dimension(0)][k] >= static_cast<double>(probability))
                    continue;
                path.throughput = Rgb{1, 1, 1} / probability;
                path.lit = path.sun_sampled = true;
                path.sunlit = s.sunlit;
            }
            if (receivers_) path.start = {.anchor = s.rays->origin[s.lane], .time = s.rays->time[s.lane]};
            assign(hits_[n_], [&] { return (*s.hits)[s.lane]; });
            directions_[n_] = s.rays->direction[s.lane];
            ++n_;
        }
    }
}

/// For unlit first surfaces only: on sunlit ones the light of small bodies, and so its noise, is comparatively
/// small.
void Wavefront::sample_small_bodies(Path& path, const PathStart& unlit) const {
    const Hit hit = (*unlit.hits)[unlit.lane];
    path.start = receiver_at(at_, hit, hit.geometric_normal);
    path.small_bodies = SmallBodySampling(tracer_, at_, path.start);
}

void Wavefront::collect_second_vertices() {
    n_second_ = 0;
    for (std::size_t i = 0; i < n_; ++i) {
        Path& path = paths_[i];
        path.lit = false;
        if (path.first_vertex < 0 || !SecondVertex::is_reusable(vertices_[i])) continue;
        path.second_vertex = static_cast<int>(n_second_);
        second_[n_second_++] =
            SecondVertex(tracer_, vertices_[i], hits_[i], static_cast<std::size_t>(path.first_vertex));
    }
}
SecondVertex* Wavefront::second_vertex(const Path& path, int vertex) {
    return vertex == 1 && path.second_vertex >= 0 ? &second_[static_cast<std::size_t>(path.second_vertex)]
                                                  : nullptr;
}
void Wavefront::reuse() {
    const double choice = sampler(starts_[0]).point(starts_[0].sample, kReuseDimensions)[0];
    rays_traced_ += first_.gather(tracer_, at_, second_.first(n_second_), choice, settings_.pixel_angle_rad,
                                  radiance_, variance_);
}

void Wavefront::draw(std::size_t first, std::uint32_t group, Points& u) const {
    const std::size_t n = std::min(kLanes, n_ - first);
    Lanes<std::uint32_t> pixel{}, sample{};
    for (std::size_t k = 0; k < n; ++k) {
        const PathStart& start = starts_[paths_[first + k].ray];
        pixel[k] = start.pixel, sample[k] = start.sample;
    }
    draw_points(transport_, n, pixel, sample, group, u);
}

void Wavefront::keep(std::size_t from, std::size_t to) {
    if (from == to) return;
    paths_[to] = paths_[from];
    hits_[to] = hits_[from];
    directions_[to] = directions_[from];
}

}  // namespace narpa
