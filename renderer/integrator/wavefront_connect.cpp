/// Next-event estimation: shadow rays from the vertices to points of emitters.
#include <algorithm>
#include <optional>

#include "base/constants.h"
#include "renderer/integrator/wavefront.h"

namespace narpa {
namespace {

/// Makes the ray deliver incident light to a second vertex.
void receive(SecondVertex& second, std::size_t kind, const Vec3& from, const Rgb& light, ShadowRay& ray) {
    second.incident[kind].from = from;
    ray.to = &second.incident[kind].light;
    ray.contribution = light;
}

}  // namespace

void Wavefront::connect(int vertex, bool lit_surfaces_count) {
    n_shadow_ = n_to_lights_ = n_to_surfaces_ = 0;
    Points u, to_background;
    for (std::size_t first = 0; first < n_; first += kLanes) {
        if (emitters_ || sun_has_extent_) draw(first, light_group(vertex), u);
        if (background_sampled_) draw(first, background_group(vertex), to_background);
        for (std::size_t k = 0; k < kLanes && first + k < n_; ++k) {
            const std::size_t i = first + k;
            Path& path = paths_[i];
            if (path.lit) continue;
            path.sun_sampled = false;
            path.small_bodies = SmallBodySampling();
            if (vertices_[i].specular()) continue;
            // Set before the shadow rays, whose MIS weights need its density.
            if (small_bodies_ && lit_surfaces_count)
                path.small_bodies = SmallBodySampling(tracer_, at_, path.start);
            SecondVertex* const second = second_vertex(path, vertex);
            if (sun_ != nullptr) sample_sun(i, u[2][k], u[3][k], second);
            if (emitters_) sample_emitters(i, u[2][k], u[0][k], u[1][k], second);
            if (background_sampled_) sample_background(i, to_background[0][k], to_background[1][k], second);
        }
        // At most two per path: the Sun's and the background's.
        if (background_sampled_) trace_shadow_rays(shadow_rays_, n_shadow_), n_shadow_ = 0;
    }
    trace_shadow_rays(shadow_rays_, n_shadow_);
    trace_shadow_rays(to_lights_, n_to_lights_);
    trace_to_surfaces();
}

/// Samples a point of the Sun's disc.
void Wavefront::sample_sun(std::size_t i, double u, double v, SecondVertex* second) {
    const Vec3 to_sun = sun_has_extent_ ? sun_->sample(u, v) : sun_->centre();
    // Escaped rays find the disc as well, unless it is a point, or the method is direct, or the Sun is narrow and
    // there is no lobe.
    const bool alone = !sun_has_extent_ || settings_.direct || (narrow_sun_ && vertices_[i].has_no_lobe());
    paths_[i].sun_sampled = alone;
    const PathVertex::Response r = vertices_[i].respond(to_sun);
    if (r.f_cos == Rgb{}) return;
    const double weight = alone ? 1 : power_heuristic(sun_->pdf(to_sun), scatter_pdf(paths_[i], to_sun, r.pdf));
    const double arriving = weight * static_cast<double>(sun_->irradiance()) / dot(to_sun, sun_->centre());
    ShadowRay& ray = shadow_rays_[n_shadow_++];
    ray.path = i;
    ray.direction = to_sun;
    ray.range_m = kInfinity;
    ray.to = paths_[i].to;
    ray.contribution = paths_[i].throughput * (r.f_cos * static_cast<float>(arriving));
    if (second == nullptr) return;
    const auto light = static_cast<float>(arriving);
    receive(*second, SecondVertex::sun, to_sun, {light, light, light}, ray);
}

/// Samples a point of one of the other emitters.
void Wavefront::sample_emitters(std::size_t i, double choice, double u, double v, SecondVertex* second) {
    const Path& path = paths_[i];
    const std::optional<LightSample> light = lights_.sample(at_, path.start, group_, choice, u, v);
    if (!light) return;
    const PathVertex::Response r = vertices_[i].respond(light->direction);
    if (r.f_cos == Rgb{}) return;
    const double pdf = scatter_pdf(path, light->direction, r.pdf);
    ShadowRay& ray = light->body < 0 ? to_lights_[n_to_lights_++] : to_surfaces_[n_to_surfaces_++];
    ray.path = i;
    ray.direction = light->direction;
    ray.to = path.to;
    ray.contribution = path.throughput * r.f_cos;
    if (second != nullptr) receive(*second, SecondVertex::emitter, light->direction, {1, 1, 1}, ray);
    ray.scatter_pdf = pdf;
    ray.body = light->body;
    ray.face = light->face;
    ray.range_m = light->body < 0 ? light->range_m : kInfinity;
    if (light->body >= 0) return;
    ray.contribution =
        ray.contribution * light->radiance_per_pdf * static_cast<float>(power_heuristic(light->pdf, pdf));
}

void Wavefront::sample_background(std::size_t i, double u, double v, SecondVertex* second) {
    const BackgroundSample s = background_.sample(u, v);
    const PathVertex::Response r = vertices_[i].respond(s.direction);
    if (!(s.pdf > 0) || r.f_cos == Rgb{}) return;
    const double weight = power_heuristic(s.pdf, scatter_pdf(paths_[i], s.direction, r.pdf));
    const Rgb arriving = s.radiance * static_cast<float>(weight / s.pdf);
    ShadowRay& ray = shadow_rays_[n_shadow_++];
    ray.path = i;
    ray.direction = s.direction;
    ray.range_m = kInfinity;
    ray.to = paths_[i].to;
    ray.contribution = paths_[i].throughput * r.f_cos * arriving;
    if (second != nullptr) receive(*second, SecondVertex::background, s.direction, arriving, ray);
}

/// Shadow rays traced together.
struct Wavefront::ShadowBatch {
    SurfacePoints from;
    Vec3Lanes directions;
    Lanes<double> range_m{};
    bool endless = true;  ///< none of the rays has an end
    std::uint32_t lanes = 0;
};
void Wavefront::fill(const PerPath<ShadowRay>& rays, std::size_t first, std::size_t end, ShadowBatch& batch) {
    const std::size_t n = std::min(kLanes, end - first);
    batch.lanes = lanes_below(n);
    batch.endless = true;
    for (std::size_t k = 0; k < n; ++k) {
        const ShadowRay& ray = rays[first + k];
        batch.from.put(k, hits_[ray.path]);
        batch.directions.put(k, ray.direction);
        batch.range_m[k] = ray.range_m;
        batch.endless &= ray.range_m == kInfinity;
    }
    rays_traced_ += n;
}

void Wavefront::trace_shadow_rays(PerPath<ShadowRay>& rays, std::size_t n) {
    ShadowBatch b;
    for (std::size_t first = 0; first < n; first += kLanes) {
        fill(rays, first, n, b);
        const std::uint32_t dark = b.endless ? tracer_.occluded(at_, b.from, b.directions, b.lanes)
                                             : tracer_.occluded(at_, b.from, b.directions, b.range_m, b.lanes);
        for_each_lane(b.lanes & ~dark, [&](std::size_t k) {
            const ShadowRay& ray = rays[first + k];
            if (medium_ == nullptr)
                *ray.to += ray.contribution;
            else
                *ray.to += ray.contribution * transmittance(ray.path, ray.direction, ray.range_m);
        });
    }
}

/// Rays to emissive surfaces: the light counts only if the hit is on the sampled face.
void Wavefront::trace_to_surfaces() {
    ShadowBatch b;
    HitBatch found;
    for (std::size_t first = 0; first < n_to_surfaces_; first += kLanes) {
        fill(to_surfaces_, first, n_to_surfaces_, b);
        found.met = 0;
        tracer_.intersect(at_, b.from, b.directions, b.lanes, found);
        for_each_lane(b.lanes & found.met, [&](std::size_t k) {
            const ShadowRay& ray = to_surfaces_[first + k];
            if (found.body[k] != ray.body || found.face[k] != ray.face) return;
            const Hit hit = found[k];
            const Path& path = paths_[ray.path];
            const double pdf = lights_.pdf(at_, path.start, group_, ray.direction, hit);
            if (!(pdf > 0)) return;  // hit at the ray's own origin
            const double weight = power_heuristic(pdf, ray.scatter_pdf);
            Rgb light = ray.contribution * emission(path, ray.direction, hit) * static_cast<float>(weight / pdf);
            if (medium_ != nullptr) light = light * transmittance(ray.path, ray.direction, hit.range_m);
            *ray.to += light;
        });
    }
}

Rgb Wavefront::emission(const Path& path, const Vec3& direction, const Hit& hit) const {
    const Material& m = render_scene_.scene().materials[static_cast<std::size_t>(hit.material)];
    if (!has_emission_map(m)) return m.emission;
    const double width_m = settings_.pixel_angle_rad * (path.length_m + hit.range_m);
    return surface_at(tracer_, at_, hit, direction, width_m).emission;
}

Rgb Wavefront::transmittance(std::size_t path, const Vec3& direction, double range_m) const {
    return medium_->transmittance(at_, {hits_[path].position, direction, hits_[path].time}, range_m);
}

}  // namespace narpa
