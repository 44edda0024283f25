#include "renderer/light/atmosphere.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/lidar_sunlight.h"

namespace narpa {
namespace {

/// Wavelength of the LiDARs' beams.
constexpr double kLidar_m = 905e-9;
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

/// An error of 1 % suffices: the light only adds shot noise, which goes with its square root.
AirResolution lidar_resolution_of(const Atmosphere& a) {
    AirResolution r;
    r.steps = std::min(a.steps, 8);
    r.heights = 12;
    return r;
}

double radius_of(const Scene& scene) {
    return scene.sun ? 0.5 * scene.sun->angular_diameter_rad : 0;
}

}  // namespace

AtmosphereMedium::AtmosphereMedium(const Scene& scene, int threads)
    : body_(static_cast<std::size_t>(scene.atmosphere->body)),
      sun_(scene.sun),
      light_(Air(scene.atmosphere->air, scene.atmosphere->samples_per_band), resolution_of(*scene.atmosphere),
             radius_of(scene), threads),
      lidar_air_(scene.atmosphere->air, kLidar_m, scene.atmosphere->steps) {
    if (std::ranges::any_of(scene.lidars, sees_sunlight))
        lidar_light_.emplace(Air(scene.atmosphere->air, kLidar_m), lidar_resolution_of(*scene.atmosphere),
                             radius_of(scene), threads);
    if (const auto* const e = std::get_if<Ellipsoid>(&scene.bodies[body_].shape)) {
        const double radius = scene.atmosphere->air.ground_radius_m;
        scale_ = {radius / e->semi_axes_m.x, radius / e->semi_axes_m.y, radius / e->semi_axes_m.z};
    }
}

AtmosphereMedium::Frame AtmosphereMedium::frame_at(const BodyPoses& at, double time) const noexcept {
    return {at.T_world_body_at(body_, time), scale_};
}

std::optional<Vec3> AtmosphereMedium::to_sun(const Frame& frame) const noexcept {
    if (!sun_) return std::nullopt;
    return normalized(frame.direction(sun_->direction));
}

MediumSegment AtmosphereMedium::segment(const AirLight& light) const noexcept {
    if (!sun_) return {light.transmittance, {}};
    return {light.transmittance, static_cast<float>(sun_->irradiance_w_m2) * light.in_scattering};
}

MediumSegment AtmosphereMedium::along(const BodyPoses& at, const Ray& ray, double range_m, double) const noexcept {
    const Frame frame = frame_at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    const std::optional<Vec3> sun = to_sun(frame);
    return segment(
        air_along(light_, frame.point(ray.origin), toward / metre, range_m * metre, sun ? &*sun : nullptr));
}

void AtmosphereMedium::along_each(const BodyPoses& at, std::span<const MediumRay> rays,
                                  std::span<MediumSegment> segments) const noexcept {
    if (rays.empty()) return;
    if (rays.size() > RayBundle::kMax) return Medium::along_each(at, rays, segments);
    double time = rays.front().ray.time;
    Frame frame = frame_at(at, time);
    const Vec3 origin = rounded(frame.point(rays.front().ray.origin), kPlace_m);
    std::optional<Vec3> sun = to_sun(frame);
    if (sun) sun = normalized(rounded(*sun, kSunDirection));
    UninitializedArray<RayBundle::Ray, RayBundle::kMax> bundle;
    UninitializedArray<AirLight, RayBundle::kMax> light;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const auto& [ray, range_m, u] = rays[i];
        if (ray.time != time) frame = frame_at(at, time = ray.time);
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
    const Frame frame = frame_at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    return transmittance_of(light_.air(), light_.columns(frame.point(ray.origin), toward / metre, range_m * metre));
}

Rgb AtmosphereMedium::ambient(const BodyPoses& at, const Vec3& position, const Vec3& normal,
                              double time) const noexcept {
    if (!sun_) return {};
    const Frame frame = frame_at(at, time);
    const Vec3 up = conjugate(frame.T_world_planet.q) * normal;
    const Vec3 to_sun = normalized(frame.direction(sun_->direction));
    const auto light = light_.skylight(frame.point(position), up, to_sun);
    return static_cast<float>(sun_->irradiance_w_m2 / 3.14159265358979323846) * bands_of(light_.air(), light);
}

double AtmosphereMedium::lidar_transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept {
    const Frame frame = frame_at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    return lidar_air_.transmittance(frame.point(ray.origin), toward / metre, range_m * metre);
}

double AtmosphereMedium::lidar_in_scattering(const BodyPoses& at, const Ray& ray, double range_m,
                                             double) const noexcept {
    if (!lidar_light_ || !sun_) return 0;
    const Frame frame = frame_at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    const Vec3 sun = *to_sun(frame);
    const AirLight light = air_along(*lidar_light_, frame.point(ray.origin), toward / metre, range_m * metre, &sun);
    return sun_->irradiance_w_m2 * static_cast<double>(light.in_scattering.x);
}

/// Lengths are not rescaled: the ellipsoid's scale changes them by 0.3 %.
Medium::Backscatter AtmosphereMedium::lidar_backscatter(const BodyPoses& at, const Ray& ray, double from_m,
                                                        double to_m) const noexcept {
    const Frame frame = frame_at(at, ray.time);
    const auto [light, range_m] =
        lidar_air_.backscattered(frame.point(ray.origin), normalized(frame.direction(ray.direction)), from_m, to_m);
    return {light, range_m};
}

}  // namespace narpa
