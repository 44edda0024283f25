#include "renderer/trace/frame_light.h"

#include <bit>
#include <cmath>
#include <utility>

#include "renderer/trace/lights.h"
#include "renderer/trace/shading.h"

namespace narpa {
namespace {

/// Only light that comes straight from its source counts.
void direct_light(const Frame& f, Packet& p, RgbPerRay& radiance) {
    const Scene& scene = f.tracer.scene();
    Lanes<Rgb> sunlit;
    std::uint32_t towards_sun = 0;
    radiance.fill({});
    p.lit = 0;
    for (std::size_t i = 0; i < p.rays.n; ++i) {
        const Hit hit = p.hits[i];
        if (hit.body < 0) continue;
        const Vec3 direction = p.rays.direction[i];
        const Surface surface = surface_at(f.tracer, f.at, hit, direction, hit.range_m * f.path.pixel_angle_rad);
        radiance.put(i, surface.emission + scene.ambient * ambient_reflectance(surface));
        if (!f.sun) continue;
        const double cosine = dot(surface.normal, p.to_sun[i]);
        if (cosine <= 0) continue;
        const Rgb reflected = bsdf(surface, surface.normal, p.to_sun[i], -direction);
        if (reflected == Rgb{}) continue;
        const double projected =
            cosine / dot(p.to_sun[i], f.sun->centre());  // the disc is sampled evenly as it faces
        sunlit[i] = reflected * (f.sun->irradiance() * static_cast<float>(projected));
        towards_sun |= 1u << i;
    }
    if (towards_sun == 0) return;
    p.lit = towards_sun & ~f.tracer.occluded(f.at, p.hits, p.to_sun, towards_sun);
    p.rays_traced += static_cast<std::uint64_t>(std::popcount(towards_sun));
    for (std::size_t i = 0; i < p.rays.n; ++i)
        if (is_set(p.lit, i)) radiance.put(i, radiance[i] + sunlit[i]);
}

template <std::size_t... I>
Lanes<PixelSampler> samplers_of(const Frame& f, const Packet& p, std::index_sequence<I...>) {
    return {PixelSampler(f.settings.seed, f.settings.frame, p.number[I])...};
}

}  // namespace

Frame make_frame(const Tracer& tracer, const Placement& at, const Camera& camera, const Rigid3& T_world_camera,
                 const FrameSettings& settings) {
    const Scene& scene = tracer.scene();
    const bool direct = settings.method == RenderSettings::Method::direct;
    // One sample passes the lens at its centre, as through a pinhole.
    const bool blurred = settings.spp > 1 && camera.lens && camera.lens->aperture_diameter_m > 0;
    const Lens* const lens = blurred ? &*camera.lens : nullptr;
    return {tracer,
            at,
            camera,
            T_world_camera,
            settings,
            lens,
            scene.sun ? std::optional<SunDisc>(*scene.sun) : std::nullopt,
            direct && !tracer.lights().beyond_the_sun(),
            {settings.max_depth, 1 / (camera.fx * std::sqrt(settings.spp)), direct},
            TinyBodies(tracer, at, camera, T_world_camera, lens)};
}

void light_along(const Frame& f, Packet& p, RgbPerRay& radiance) {
    if (f.quick) {
        direct_light(f, p, radiance);
        return;
    }
    Lanes<Ray> rays;
    Lanes<Hit> hits;
    Lanes<Rgb> light;
    for (std::size_t i = 0; i < p.rays.n; ++i) rays[i] = p.rays[i], hits[i] = p.hits[i];
    path_radiance(f.tracer, f.at, f.path, std::span(rays).first(p.rays.n), std::span(hits).first(p.rays.n),
                  samplers_of(f, p, std::make_index_sequence<kPacket>()), p.sample, light);
    for (std::size_t i = 0; i < p.rays.n; ++i) radiance.put(i, light[i]);
}

}  // namespace narpa
