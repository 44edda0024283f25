#include "renderer/light/air_for_lidar.h"

#include <algorithm>

#include "renderer/scene/lidar_sunlight.h"

namespace narpa {
namespace {

/// Wavelength of the LiDARs' beams.
constexpr double kLidar_m = 905e-9;

/// An error of 1 % suffices: the light only adds shot noise, which goes with its square root.
AirResolution lidar_resolution_of(const Atmosphere& a) {
    AirResolution r;
    r.steps = std::min(a.steps, 8);
    r.heights = 12;
    return r;
}

class LidarsAlone final : public Medium {
public:
    LidarsAlone(const Scene& scene, int threads) : lidar_(std::make_shared<const AirForLidar>(scene, threads)) {}
    [[nodiscard]] MediumSegment along(const BodyPoses&, const Ray&, double, double) const noexcept override {
        return {};
    }
    [[nodiscard]] bool uses_random_numbers() const noexcept override { return false; }
    [[nodiscard]] Rgb transmittance(const BodyPoses&, const Ray&, double) const noexcept override {
        return {1, 1, 1};
    }
    [[nodiscard]] std::shared_ptr<const LidarMedium> for_lidar() const override { return lidar_; }
    [[nodiscard]] int body() const noexcept override { return lidar_->body(); }

private:
    std::shared_ptr<const LidarMedium> lidar_;
};

}  // namespace

std::unique_ptr<const Medium> air_for_lidars_alone(const Scene& scene, int threads) {
    return std::make_unique<LidarsAlone>(scene, threads);
}

AirForLidar::AirForLidar(const Scene& scene, int threads)
    : planet_(scene), sun_(scene.sun), air_(scene.atmosphere->air, kLidar_m, scene.atmosphere->steps) {
    if (sun_ && std::ranges::any_of(scene.lidars, sees_sunlight))
        sunlight_.emplace(Air(scene.atmosphere->air, kLidar_m), lidar_resolution_of(*scene.atmosphere),
                          0.5 * sun_->angular_diameter_rad, threads);
}

double AirForLidar::transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept {
    const Planet::Frame frame = planet_.at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    return air_.transmittance(frame.point(ray.origin), toward / metre, range_m * metre);
}

double AirForLidar::in_scattering(const BodyPoses& at, const Ray& ray, double range_m, double) const noexcept {
    if (!sunlight_) return 0;
    const Planet::Frame frame = planet_.at(at, ray.time);
    const Vec3 toward = frame.direction(ray.direction);
    const double metre = norm(toward);
    const Vec3 sun = normalized(frame.direction(sun_->direction));
    const AirLight light = air_along(*sunlight_, frame.point(ray.origin), toward / metre, range_m * metre, &sun);
    return sun_->irradiance_w_m2 * static_cast<double>(light.in_scattering.x);
}

LidarMedium::Backscatter AirForLidar::backscatter(const BodyPoses& at, const Ray& ray, double from_m,
                                                  double to_m) const noexcept {
    const Planet::Frame frame = planet_.at(at, ray.time);
    const auto [light, range_m] =
        air_.backscattered(frame.point(ray.origin), normalized(frame.direction(ray.direction)), from_m, to_m);
    return {light, range_m};
}

}  // namespace narpa
