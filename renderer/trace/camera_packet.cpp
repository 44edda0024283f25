#include "renderer/trace/camera_packet.h"

#include "renderer/trace/camera_ray.h"
#include "renderer/trace/lens.h"

namespace narpa {
namespace {

void aim_at_middles(const Frame& f, const CameraSamples& s, Packet& p) {
    p.rays.n = s.n;
    for (std::size_t i = 0; i < s.n; ++i) p.rays.put(i, camera_ray(f.camera, f.T_world_camera, s.x[i], s.y[i]));
    if (f.sun) p.to_sun.fill(f.sun->centre());
}

/// Each at its own point of the pixel, of the lens and of the Sun.
void aim(const Frame& f, const CameraSamples& s, Packet& p) {
    p.rays.n = s.n;
    for (std::size_t i = 0; i < s.n; ++i) {
        const PixelSampler sampler(f.settings.seed, f.settings.frame, s.number[i]);
        const SamplePoint u = sampler.point(s.sample[i]);
        const double x = s.x[i] + u[0] - 0.5, y = s.y[i] + u[1] - 0.5;
        if (f.lens == nullptr) {
            p.rays.put(i, camera_ray(f.camera, f.T_world_camera, x, y));
            if (f.sun) p.to_sun.put(i, f.sun->sample(u[2], u[3]));
        } else {
            p.rays.put(i, lens_ray(f.camera, *f.lens, f.T_world_camera, x, y, aperture_point(*f.lens, u[2], u[3])));
            if (!f.sun || !f.quick) continue;
            const SamplePoint more = sampler.point(s.sample[i], 1);
            p.to_sun.put(i, f.sun->sample(more[0], more[1]));
        }
    }
}

}  // namespace

void trace_samples(const Frame& f, const CameraSamples& s, std::span<const std::uint32_t> bodies, Packet& p,
                   RgbPerRay& radiance) {
    if (s.middle)
        aim_at_middles(f, s, p);
    else
        aim(f, s, p);
    p.number = s.number;
    p.sample = s.sample;
    f.tracer.intersect(f.at, p.rays, bodies, p.hits);
    p.rays_traced += s.n;
    if (f.tiny.any())
        for (std::size_t i = 0; i < s.n; ++i) p.hits.put(i, f.tiny.beyond(p.rays[i], p.hits[i]));
    light_along(f, p, radiance);
}

void trace_middles(const Frame& f, const CameraSamples& s, Packet& p) {
    aim_at_middles(f, s, p);
    f.tracer.intersect(f.at, p.rays, f.tracer.all_bodies(), p.hits);
    p.rays_traced += s.n;
}

}  // namespace narpa
