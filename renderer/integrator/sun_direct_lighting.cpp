#include "renderer/integrator/sun_direct_lighting.h"

#include <algorithm>
#include <bit>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/integrator/shading.h"
#include "renderer/material/phong_lobe.h"

namespace narpa {
namespace {

/// Hit surfaces of Lambert's and Phong's materials, lane by lane.
struct SurfaceLanes {
    RgbLanes diffuse, specular, emission;
    Lanes<float> exponent;
    Vec3Lanes normal;
    std::uint32_t lanes = 0;   ///< lanes that are set
    std::uint32_t shiny = 0;   ///< lanes with a lobe
    std::uint32_t others = 0;  ///< hits on materials of other kinds
};

/// Unshadowed sunlight reflected along each ray.
struct Sunlight {
    RgbLanes radiance;
    std::uint32_t lanes = 0;  ///< lanes where it is not zero
};

Surface surface_of(const Transport& t, const TracedRays& p, std::size_t i) {
    return surface_at(t.render_scene.tracer(), t.at, p.hits[i], p.rays.direction[i],
                      p.hits.range_m[i] * t.path.pixel_angle_rad);
}

void put(SurfaceLanes& surfaces, std::size_t i, const Rgb& diffuse, const Rgb& specular, const Rgb& emission,
         float exponent) {
    surfaces.diffuse.put(i, diffuse);
    surfaces.specular.put(i, specular);
    surfaces.emission.put(i, emission);
    surfaces.exponent[i] = exponent;
}

NARPA_EACH_ISA void fill(SurfaceLanes& surfaces, const Material& m, const Rgb& specular) {
    surfaces.diffuse.fill(m.diffuse);
    surfaces.specular.fill(specular);
    surfaces.emission.fill(m.emission);
    surfaces.exponent.fill(m.exponent);
}

/// Material by material: a batch rarely meets more than two.
void gather_surfaces(const Transport& t, const TracedRays& p, SurfaceLanes& surfaces) {
    const Scene& scene = t.render_scene.scene();
    surfaces.normal = p.hits.shading_normal;
    bool filled = false;
    for (std::uint32_t left = p.hits.met; left != 0;) {
        const int material = p.hits.material[static_cast<std::size_t>(std::countr_zero(left))];
        const std::uint32_t same = lanes_with(p.hits.material, material) & left;
        left &= ~same;
        const Material& m = scene.materials[static_cast<std::size_t>(material)];
        const Rgb specular = lobe_colour(m);
        if (!filled) fill(surfaces, m, specular), filled = true;
        if (!is_lambert_or_phong(m)) {
            surfaces.others |= same;
            continue;
        }
        surfaces.lanes |= same;
        if (specular != Rgb{}) surfaces.shiny |= same;
        if (is_textured(m))
            for_each_lane(same, [&](std::size_t i) {
                const Surface s = surface_of(t, p, i);
                put(surfaces, i, s.diffuse, s.specular, s.emission, s.exponent);
                surfaces.normal.put(i, s.normal);
            });
        else if (surfaces.lanes != same || surfaces.others != 0)
            for_each_lane(same,
                          [&](std::size_t i) { put(surfaces, i, m.diffuse, specular, m.emission, m.exponent); });
    }
}

/// Emission and ambient light of the lanes that are set.
NARPA_EACH_ISA void emit(const SurfaceLanes& surfaces, const Rgb& ambient, RgbLanes& radiance) noexcept {
    RgbLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        out.r[i] = surfaces.emission.r[i] + ambient.x * (surfaces.diffuse.r[i] + surfaces.specular.r[i]);
        out.g[i] = surfaces.emission.g[i] + ambient.y * (surfaces.diffuse.g[i] + surfaces.specular.g[i]);
        out.b[i] = surfaces.emission.b[i] + ambient.z * (surfaces.diffuse.b[i] + surfaces.specular.b[i]);
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool is = (surfaces.lanes >> i & 1u) != 0;
        out.r[i] = is ? out.r[i] : 0;
        out.g[i] = is ? out.g[i] : 0;
        out.b[i] = is ? out.b[i] : 0;
    }
    radiance = out;
}

/// Phong's lobe about the mirror direction (bsdf.h), without its colour; 0 where the material has none.
void lobes_of(const SurfaceLanes& surfaces, const Lanes<double>& r_v, Lanes<float>& lobe) noexcept {
    for (std::size_t i = 0; i < kLanes; ++i) {
        lobe[i] = phong_lobe(r_v[i], surfaces.exponent[i]);
    }
}

NARPA_EACH_ISA void reflect_sun(const SurfaceLanes& surfaces, const Vec3Lanes& direction, const Vec3Lanes& to_sun,
                                const Vec3& centre, float irradiance, Sunlight& out) noexcept {
    constexpr float inv_pi = static_cast<float>(std::numbers::inv_pi);
    const Vec3Lanes& n = surfaces.normal;
    Lanes<double> r_v;
    Lanes<float> arriving, lobe{};
    Lanes<std::uint32_t> faces;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double n_l = n.x[i] * to_sun.x[i] + n.y[i] * to_sun.y[i] + n.z[i] * to_sun.z[i];
        const double n_v = -(n.x[i] * direction.x[i] + n.y[i] * direction.y[i] + n.z[i] * direction.z[i]);
        const double l_v =
            -(to_sun.x[i] * direction.x[i] + to_sun.y[i] * direction.y[i] + to_sun.z[i] * direction.z[i]);
        const double as_centre = to_sun.x[i] * centre.x + to_sun.y[i] * centre.y + to_sun.z[i] * centre.z;
        r_v[i] = 2 * n_l * n_v - l_v;
        // The disc is sampled uniformly in projected area.
        arriving[i] = irradiance * static_cast<float>(n_l / as_centre);
        faces[i] = static_cast<std::uint32_t>(n_l > 0) & static_cast<std::uint32_t>(n_v > 0);
    }
    if (surfaces.shiny != 0) lobes_of(surfaces, r_v, lobe);
    RgbLanes reflected;
    Lanes<std::uint32_t> sent;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const float r = surfaces.diffuse.r[i] * inv_pi + surfaces.specular.r[i] * lobe[i];
        const float g = surfaces.diffuse.g[i] * inv_pi + surfaces.specular.g[i] * lobe[i];
        const float b = surfaces.diffuse.b[i] * inv_pi + surfaces.specular.b[i] * lobe[i];
        const bool dark = (r == 0) & (g == 0) & (b == 0);
        sent[i] = dark ? 0 : faces[i];
        reflected.r[i] = r * arriving[i];
        reflected.g[i] = g * arriving[i];
        reflected.b[i] = b * arriving[i];
    }
    std::uint32_t lanes = 0;
    for (std::size_t i = 0; i < kLanes; ++i) lanes |= sent[i] << i;
    out.radiance = reflected;
    out.lanes = lanes & surfaces.lanes;
}

/// The same for one lane of another material.
void light_other(const Transport& t, const TracedRays& p, std::size_t i, RgbLanes& radiance, Sunlight& sunlight) {
    const Surface surface = surface_of(t, p, i);
    radiance.put(i, surface.emission + t.render_scene.background().ambient() * ambient_reflectance(surface));
    const std::optional<SunDisc>& sun = t.render_scene.lights().sun();
    if (!sun) return;
    const double cosine = dot(surface.normal, p.to_sun[i]);
    if (cosine <= 0) return;
    const Rgb reflected = bsdf(surface, surface.normal, p.to_sun[i], -p.rays.direction[i]);
    if (reflected == Rgb{}) return;
    const double projected = cosine / dot(p.to_sun[i], sun->centre());
    sunlight.radiance.put(i, reflected * (sun->irradiance() * static_cast<float>(projected)));
    sunlight.lanes |= 1u << i;
}

/// Adds sunlight in the lanes `lit`.
NARPA_EACH_ISA void add_sunlight(const Sunlight& sunlight, std::uint32_t lit, RgbLanes& radiance) noexcept {
    RgbLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool is = (lit >> i & 1u) != 0;
        out.r[i] = radiance.r[i] + (is ? sunlight.radiance.r[i] : 0);
        out.g[i] = radiance.g[i] + (is ? sunlight.radiance.g[i] : 0);
        out.b[i] = radiance.b[i] + (is ? sunlight.radiance.b[i] : 0);
    }
    radiance = out;
}

/// Traces the shadow rays of the lanes set, and adds the unshadowed sunlight.
void add_sun(const Transport& t, TracedRays& p, Sunlight& sunlight, PhaseClock& clock, RgbLanes& radiance) {
    clock.ends(Phase::shading);
    if (sunlight.lanes == 0) return;
    p.lit = sunlight.lanes & ~t.render_scene.tracer().occluded(t.at, p.hits, p.to_sun, sunlight.lanes);
    p.rays_traced += static_cast<std::uint64_t>(std::popcount(sunlight.lanes));
    clock.ends(Phase::shadow_rays);
    if (p.lit != 0) add_sunlight(sunlight, p.lit, radiance);
}

/// Lanes on flat faces whose lobe is not too sharp: next-event estimation alone suffices for the Sun there.
NARPA_EACH_ISA std::uint32_t sunlit_by_nee_alone(const HitBatch& hits, const SurfaceLanes& surfaces) noexcept {
    const Vec3Lanes &flat = hits.geometric_normal, &n = surfaces.normal;
    Lanes<int> are;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool same = (flat.x[i] == n.x[i]) & (flat.y[i] == n.y[i]) & (flat.z[i] == n.z[i]);
        are[i] = -static_cast<int>(same & (surfaces.exponent[i] <= kSharpLobe));
    }
    return bits_of(are) & surfaces.lanes;
}

}  // namespace

bool SunDirectLighting::suffices(const RenderScene& render_scene) noexcept {
    return !render_scene.lights().any(Lights::Group::lights) && render_scene.background().uniform() &&
           render_scene.medium() == nullptr;
}

void SunDirectLighting::radiance(const Transport& t, TracedRays& p, RgbLanes& radiance) const noexcept {
    assert(p.rays.n <= kLanes && (p.hits.met & ~lanes_below(p.rays.n)) == 0);
    p.lit = 0;
    if (p.hits.met == 0) {
        radiance.fill({});
        return;
    }
    PhaseClock clock(p.times);
    SurfaceLanes surfaces;
    Sunlight sunlight;
    gather_surfaces(t, p, surfaces);
    emit(surfaces, t.render_scene.background().ambient(), radiance);
    if (const std::optional<SunDisc>& sun = t.render_scene.lights().sun(); sun && surfaces.lanes != 0)
        reflect_sun(surfaces, p.rays.direction, p.to_sun, sun->centre(), sun->irradiance(), sunlight);
    for_each_lane(surfaces.others, [&](std::size_t i) { light_other(t, p, i, radiance, sunlight); });
    add_sun(t, p, sunlight, clock, radiance);
}

void SunDirectLighting::radiance(const Transport& t, std::span<TracedRays> batches,
                                 std::span<BatchRadiance> light) const noexcept {
    for (std::size_t k = 0; k < batches.size(); ++k) radiance(t, batches[k], light[k].direct);
}

void add_first_hit_sunlight(const Transport& t, TracedRays& p, RgbLanes& radiance) noexcept {
    PhaseClock clock(p.times);
    SurfaceLanes surfaces;
    Sunlight sunlight;
    gather_surfaces(t, p, surfaces);
    surfaces.lanes = sunlit_by_nee_alone(p.hits, surfaces);
    if (surfaces.lanes == 0) return;
    p.first.lanes = surfaces.lanes;
    p.first.diffuse = surfaces.diffuse;
    p.first.specular = surfaces.specular;
    emit(surfaces, {}, radiance);
    const SunDisc& sun = *t.render_scene.lights().sun();
    reflect_sun(surfaces, p.rays.direction, p.to_sun, sun.centre(), sun.irradiance(), sunlight);
    add_sun(t, p, sunlight, clock, radiance);
}

}  // namespace narpa
