#include "renderer/lidar/lidar_shot.h"

#include "renderer/integrator/shading.h"

namespace narpa {

LidarReturn shoot(const Tracer& tracer, const BodyPoses& at, const Ray& beam, double range_max_m) noexcept {
    const Hit hit = tracer.intersect(at, beam, range_max_m);
    if (hit.body < 0) return {};
    const Vec3 back = -beam.direction;
    const Surface surface = surface_at(tracer, at, hit, beam.direction, 0);
    const Rgb f = bsdf(surface, surface.normal, back, back);
    const double cosine = dot(surface.normal, back);
    constexpr double kPi = 3.14159265358979323846;
    return {hit.range_m, static_cast<float>(kPi * cosine * static_cast<double>(f.x + f.y + f.z) / 3), hit.body};
}

}  // namespace narpa
