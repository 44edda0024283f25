// Noise of a LiDAR from sunlight that air scatters into its beam: against what a camera's pixel sees there.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/atmosphere/refraction/ray_bundle.h"
#include "renderer/lidar/lidar_receiver.h"
#include "renderer/light/atmosphere.h"
#include "tests/renderer/integrator/path_support.h"
#include "tests/renderer/lidar/lidar_support.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kSun_w_m2 = 1361;

/// Thin haze, evenly lit.
class Haze final : public Medium {
public:
    static constexpr double kExtinction_1_m = 0.01, kSource = 0.3 * kSun_w_m2 / kPi;

    [[nodiscard]] MediumSegment along(const BodyPoses& at, const Ray& ray, double range_m,
                                      double) const noexcept override {
        const Rgb through = transmittance(at, ray, range_m);
        return {through, static_cast<float>(kSource) * (Rgb{1, 1, 1} - through)};
    }
    /// Above z = 60 m it is clear: the Sun, which is beyond, is dimmed by a known depth.
    [[nodiscard]] Rgb transmittance(const BodyPoses&, const Ray& ray, double range_m) const noexcept override {
        const double within_m =
            ray.direction.z > 0 ? std::min(range_m, (60 - ray.origin.z) / ray.direction.z) : range_m;
        const auto t = static_cast<float>(std::exp(-kExtinction_1_m * within_m));
        return {t, t, t};
    }
};

/// From the origin along these directions. Of a receiver that hears all.
std::vector<LidarEchoes> shots(const RenderScene& render_scene, const LidarReceiverModel& model,
                               const Vec3& direction, std::size_t n) {
    return shots_along(direction, render_scene, model, n, {.medium = render_scene.lidar_medium()});
}

/// What a camera's pixel sees there, in units of a white surface that faces the Sun.
double pixel(const RenderScene& render_scene, const Vec3& direction) {
    const Estimate seen = light_along(render_scene, placed(render_scene.scene()), {{}, direction},
                                      {.max_depth = 1, .direct = true}, 1);
    return kPi / kSun_w_m2 * (seen.mean.x + seen.mean.y + seen.mean.z) / 3;
}

/// A sunlit plate 50 m ahead, and one 30 m below that is in the shade.
Scene plates() {
    Scene scene;
    scene.materials.push_back(lambert(0.5f));
    add_mesh(scene, plate(20, 20), {exp_rotation({0, kPi - 0.3, 0}), {0, 0, 50}});
    add_mesh(scene, plate(20, 20), {exp_rotation({-kPi / 2, 0, 0}), {0, -30, 0}});
    add_sun(scene, {0.3, -1, 0.4}, kSun_w_m2);
    return scene;
}

TEST(LidarSunlitAir, IsAsBrightAsACamerasPixel) {
    const Scene scene = plates();
    const auto hazy = RenderScene::create(scene, 1, nullptr, std::make_unique<Haze>());
    ASSERT_TRUE(hazy);
    for (const Vec3& direction : {Vec3{0, 0, 1}, Vec3{0, -1, 0}}) {
        const LidarReceiverModel model{.range_at_10_percent_m = 1000, .sunlight_noise = 2};
        const double seen = pixel(*hazy, direction);
        EXPECT_GT(seen, 0.05);
        EXPECT_NEAR(shots(*hazy, model, direction, 1)[0].sunlight, seen, 1e-5 * seen) << direction.y;
    }
}

/// Phi(snr (x / s - 1)) of the echoes are detected, s = sqrt(1 + noise * radiance).
TEST(LidarSunlitAir, RaisesTheThreshold) {
    Scene scene = plates();
    const auto hazy = RenderScene::create(scene, 1, nullptr, std::make_unique<Haze>());
    ASSERT_TRUE(hazy);
    constexpr double kSnr = 5, kNoise = 8;
    constexpr std::size_t kShots = 20'000;
    const Vec3 ahead{0, 0, 1};
    const double s = std::sqrt(1 + kNoise * pixel(*hazy, ahead)),
                 light = 0.5 * std::cos(0.3) * std::exp(-2 * 50 * Haze::kExtinction_1_m) / 2500;
    for (const double strength : {1.0, 1.2, 1.6}) {
        const double expected = 0.5 * std::erfc(kSnr * (1 - strength / s) / std::sqrt(2));
        std::size_t found = 0;
        for (const LidarEchoes& e : shots(*hazy,
                                          {.range_at_10_percent_m = std::sqrt(0.1 * strength / light),
                                          .detection_snr = kSnr,
                                          .sunlight_noise = kNoise},
                                          ahead, kShots))
            found += e.strongest.range_m > 0 ? 1 : 0;
        EXPECT_NEAR(static_cast<double>(found) / kShots, expected,
                    4 * std::sqrt(std::max(1e-4, expected * (1 - expected)) / kShots))
            << strength;
    }
}

/// A planet's air as a camera at the LiDARs' wavelength would show it.
class AirAt905 final : public Medium {
public:
    explicit AirAt905(const Scene& scene)
        : light_(Air(scene.atmosphere->air, 905e-9), {}, 0.5 * scene.sun->angular_diameter_rad, 1),
          sun_(*scene.sun) {}
    [[nodiscard]] MediumSegment along(const BodyPoses& at, const Ray& ray, double range_m,
                                      double) const noexcept override {
        const AirLight air =
            air_along(light_, ray.origin - at.T_world_body[0].t, ray.direction, range_m, &sun_.direction);
        return {air.transmittance, static_cast<float>(sun_.irradiance_w_m2) * air.in_scattering};
    }
    [[nodiscard]] Rgb transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept override {
        return along(at, ray, range_m, 0).transmittance;
    }

private:
    ScatteredLight light_;
    Sun sun_;
};

/// On the ground, 2 m up: the sky in several directions, the haze before a hill, and the ground.
TEST(LidarSunlitAir, OfAPlanetIsThatAtItsWavelength) {
    Scene scene;
    scene.materials.push_back(lambert(0.3f));
    const double radius_m = earth_air().ground_radius_m;
    add_sphere(scene, radius_m, {0, 0, -radius_m - 2});
    add_mesh(scene, plate(2000, 2000), {exp_rotation({0, -kPi / 2, 0}), {5000, 0, 0}});
    add_sun(scene, {-0.6, 0.2, 0.5}, kSun_w_m2);
    scene.sun->angular_diameter_rad = 0.0093;
    scene.atmosphere = Atmosphere{.body = 0, .air = earth_air(3)};
    scene.lidars.emplace_back().receiver = {.range_at_10_percent_m = 1e5, .sunlight_noise = 1};
    const auto with_air = RenderScene::create(scene, 1);
    ASSERT_TRUE(with_air);
    const auto as_a_camera = RenderScene::create(scene, 1, nullptr, std::make_unique<AirAt905>(scene));
    ASSERT_TRUE(as_a_camera);
    for (const Vec3& direction : {Vec3{1, 0, 0.05}, Vec3{0.3, 0, -1}}) {
        const double seen = pixel(*as_a_camera, normalized(direction));
        EXPECT_NEAR(shots(*with_air, scene.lidars[0].receiver, normalized(direction), 1)[0].sunlight, seen,
                    0.01 * seen)
            << direction.x;
    }
    // Where nothing is met, for air echoes and for what some instruments report.
    const BodyPoses at = placed(scene);
    for (const Vec3& direction : {Vec3{0, 0, 1}, Vec3{0, 1, 0.2}, Vec3{-0.5, 0.2, 0.5}}) {
        const Ray ray{{}, normalized(direction)};
        const double sky = kPi / kSun_w_m2 * with_air->lidar_medium()->in_scattering(at, ray, kInfinity, 0);
        const double seen = pixel(*as_a_camera, ray.direction);
        EXPECT_GT(seen, 1e-3);
        EXPECT_NEAR(sky, seen, 0.01 * seen) << direction.x;
    }
    // Clear sky is fainter there than in red light, haze as bright.
    const Ray zenith{{}, {0, 0, 1}};
    const double red = static_cast<double>(with_air->medium()->along(at, zenith, kInfinity, 0).in_scattering.x);
    EXPECT_LT(with_air->lidar_medium()->in_scattering(at, zenith, kInfinity, 0), 0.6 * red);
}

/// An instrument that does not look at sunlight pays nothing: no second set of tables.
TEST(LidarSunlitAir, IsMadeForLidarsThatSeeSunlightAlone) {
    Scene scene;
    scene.materials.push_back(lambert(0.3f));
    const double radius_m = earth_air().ground_radius_m;
    add_sphere(scene, radius_m, {0, 0, -radius_m - 2});
    add_sun(scene, {-0.6, 0.2, 0.5}, kSun_w_m2);
    scene.atmosphere = Atmosphere{.body = 0, .air = earth_air(3)};
    scene.lidars.emplace_back().receiver = {.range_at_10_percent_m = 1e5};
    const auto with_air = RenderScene::create(scene, 1);
    ASSERT_TRUE(with_air);
    EXPECT_EQ(with_air->lidar_medium()->in_scattering(placed(scene), {{}, {0, 0, 1}}, kInfinity, 0), 0);
    EXPECT_EQ(shots(*with_air, scene.lidars[0].receiver, {0, 0, -1}, 1)[0].sunlight, 0);
}

}  // namespace
}  // namespace narpa
