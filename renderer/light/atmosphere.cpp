#include "renderer/light/atmosphere.h"

#include <cassert>
#include <cmath>

#include "renderer/geometry/shape_kind.h"
#include "renderer/light/air_for_lidar.h"

namespace narpa {
namespace {

/// Rays whose origins are this close (as on a lens) are treated as having one origin. Origins are rounded to
/// kPlace_m and Sun directions to kSunDirection, so that they share cells (AirCache).
constexpr double kOnePlace_m = 1, kPlace_m = 0.25, kSunDirection = 0x1p-20;

Vec3 rounded(const Vec3& v, double step) {
    return {step * std::round(v.x / step), step * std::round(v.y / step), step * std::round(v.z / step)};
}

AirResolution resolution_of(const Atmosphere& a) {
    AirResolution r;
    r.steps = a.steps;
    return r;
}

std::optional<Vec3> to_sun(const std::optional<Sun>& sun, const Planet::Frame& frame) noexcept {
    if (!sun) return std::nullopt;
    return normalized(frame.direction(sun->direction));
}

}  // namespace

Planet::Planet(const Scene& scene) : body(static_cast<std::size_t>(scene.atmosphere->body)) {
    assert(body < scene.bodies.size());
    const double radius = scene.atmosphere->air.ground_radius_m;
    const auto axes = semi_axes_m(scene.bodies[body]);
    if (axes && !(axes->x == axes->y && axes->y == axes->z)) scale = Vec3{radius, radius, radius} / *axes;
}

AtmosphereMedium::AtmosphereMedium(const Scene& scene, int threads)
    : planet_(scene),
      sun_(scene.sun),
      light_(Air(scene.atmosphere->air, scene.atmosphere->samples_per_band), resolution_of(*scene.atmosphere),
             scene.sun ? 0.5 * scene.sun->angular_diameter_rad : 0, threads),
      lidar_(std::make_shared<const AirForLidar>(scene, threads)) {}

MediumSegment AtmosphereMedium::segment(const AirLight& light) const noexcept {
    if (!sun_) return {light.transmittance, {}};
    return {light.transmittance, static_cast<float>(sun_->irradiance_w_m2) * light.in_scattering};
}

MediumSegment AtmosphereMedium::along(const BodyPoses& at, const Ray& ray, double range_m, double) const noexcept {
    const Planet::Frame frame = planet_.at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    const std::optional<Vec3> sun = to_sun(sun_, frame);
    return segment(
        air_along(light_, frame.point(ray.origin), toward / metre, range_m * metre, sun ? &*sun : nullptr));
}

void AtmosphereMedium::along_each(const BodyPoses& at, std::span<const MediumRay> rays,
                                  std::span<MediumSegment> segments) const noexcept {
    if (rays.empty()) return;
    if (rays.size() > RayBundle::kMax) return Medium::along_each(at, rays, segments);
    double time = rays.front().ray.time;
    Planet::Frame frame = planet_.at(at, time);
    const Vec3 origin = rounded(frame.point(rays.front().ray.origin), kPlace_m);
    std::optional<Vec3> sun = to_sun(sun_, frame);
    if (sun) sun = normalized(rounded(*sun, kSunDirection));
    UninitializedArray<RayBundle::Ray, RayBundle::kMax> bundle;
    UninitializedArray<AirLight, RayBundle::kMax> light;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const auto& [ray, range_m, u] = rays[i];
        if (ray.time != time) frame = planet_.at(at, time = ray.time);
        if (norm(frame.point(ray.origin) - origin) > kOnePlace_m) return Medium::along_each(at, rays, segments);
        const Vec3 toward = frame.direction(ray.direction);
        const double metre = norm(toward);
        bundle[i] = {toward / metre, range_m * metre};
    }
    RayBundle(light_, origin, sun ? &*sun : nullptr, *cells_)
        .trace(bundle.first(rays.size()), light.first(rays.size()));
    for (std::size_t i = 0; i < rays.size(); ++i) segments[i] = segment(light[i]);
}

Rgb AtmosphereMedium::transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept {
    const Planet::Frame frame = planet_.at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    return transmittance_of(light_.air(), light_.columns(frame.point(ray.origin), toward / metre, range_m * metre));
}

Rgb AtmosphereMedium::ambient(const BodyPoses& at, const Vec3& position, const Vec3& normal,
                              double time) const noexcept {
    if (!sun_) return {};
    const Planet::Frame frame = planet_.at(at, time);
    const Vec3 up = conjugate(frame.T_world_planet.q) * normal;
    const Vec3 to_sun = normalized(frame.direction(sun_->direction));
    const auto light = light_.skylight(frame.point(position), up, to_sun);
    return static_cast<float>(sun_->irradiance_w_m2 / 3.14159265358979323846) * bands_of(light_.air(), light);
}

}  // namespace narpa
