#include "renderer/lidar/lidar_shot.h"

#include <numbers>

#include "renderer/integrator/shading.h"

namespace narpa {

void shoot(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, double range_max_m,
           std::span<LidarReturn> returns) noexcept {
    HitBatch hits;
    tracer.intersect(at, beams, tracer.all_bodies(), hits);
    for (std::size_t i = 0; i < beams.n; ++i) {
        returns[i] = {};
        if (!is_set(hits.met, i) || !(hits.range_m[i] < range_max_m)) continue;
        const Vec3 direction = beams.direction[i], back = -direction;
        const Surface surface = surface_at(tracer, at, hits[i], direction, 0);
        const Rgb f = bsdf(surface, surface.normal, back, back);
        const double cosine = dot(surface.normal, back);
        returns[i] = {hits.range_m[i],
                      static_cast<float>(std::numbers::pi * cosine * static_cast<double>(f.x + f.y + f.z) / 3),
                      hits.body[i]};
    }
}

LidarReturn shoot(const Tracer& tracer, const BodyPoses& at, const Ray& beam, double range_max_m) noexcept {
    RayBatch beams;
    beams.n = 1;
    beams.put(0, beam);
    LidarReturn seen;
    shoot(tracer, at, beams, range_max_m, {&seen, 1});
    return seen;
}

}  // namespace narpa
