// The air of a scene: sky, sunlight, ambient light, LiDAR.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "base/constants.h"
#include "renderer/atmosphere/air_path.h"
#include "renderer/lidar/lidar_shot.h"
#include "renderer/light/atmosphere.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace narpa::test;

Vec3 at_zenith_angle(double zenith_deg, double azimuth_deg) {
    const double z = zenith_deg * kRadPerDeg, a = azimuth_deg * kRadPerDeg;
    return {std::sin(z) * std::cos(a), std::sin(z) * std::sin(a), std::cos(z)};
}

/// An Earth of 6371 km; viewers are above its north pole.
Scene earth_scene(double sun_zenith_deg) {
    Scene s;
    s.materials.push_back(lambert(0.3f));
    add_sphere(s, 6'371'000, {});
    s.sun = Sun{.direction = at_zenith_angle(sun_zenith_deg, 0)};
    s.atmosphere.emplace();
    s.atmosphere->air = earth_air();
    s.atmosphere->air.ground_albedo = 0.3;
    return s;
}

TEST(AtmosphereInAScene, GroundAndSkyAreBrightInTheirColours) {
    const Scene s = earth_scene(40);
    const auto render_scene = RenderScene::create(s, 2);
    ASSERT_TRUE(render_scene);
    const Vec3 eye{0, 0, 6'371'002};
    for (const bool direct : {false, true}) {
        const PathSettings settings{.max_depth = 4, .direct = direct};
        const Vec3 up = light_along(*render_scene, placed(s), {eye, at_zenith_angle(30, 90)}, settings, 1).mean;
        EXPECT_GT(up.z, 1.3 * up.y);
        EXPECT_GT(up.y, 1.2 * up.x);
        const Vec3 down = light_along(*render_scene, placed(s), {eye, {0, 0, -1}}, settings, direct ? 1 : 512).mean;
        // Global irradiance: the balance of 0.3 / pi * 1361 * cos(40), a fifth less.
        const double vacuum = 0.3 / kPi * 1361 * std::cos(40 * kRadPerDeg);
        EXPECT_GT(down.y, 0.80 * vacuum) << direct;
        EXPECT_LT(down.y, 1.0 * vacuum) << direct;
    }
    const Vec3 direct =
        light_along(*render_scene, placed(s), {eye, {0, 0, -1}}, PathSettings{.max_depth = 4, .direct = true}, 1)
            .mean;
    const Vec3 paths =
        light_along(*render_scene, placed(s), {eye, {0, 0, -1}}, PathSettings{.max_depth = 4}, 2048).mean;
    EXPECT_NEAR(direct.y / paths.y, 1, 0.02);
    EXPECT_NEAR(direct.z / paths.z, 1, 0.02);
}

TEST(AtmosphereInAScene, ALampThatHardlyShinesAddsNoSkylight) {
    // Lamps that have an extent are sought by a further ray, on whose way there is air.
    Scene s = earth_scene(40);
    s.atmosphere->samples_per_band = 1;
    s.atmosphere->steps = 4;
    add_sphere(s, 1, {0, 0, 6'371'001});
    const Ray ray = ray_to({0, -5, 6'371'002}, {0.3, 0, 6'371'001.2});
    const PathSettings settings{.direct = true};
    const Vec3 without = light_along(s, ray, settings, 16).mean;
    Light dim;
    dim.kind = Light::Kind::disc;
    dim.radius_m = 1e-3;
    dim.emission = {1e-9f, 1e-9f, 1e-9f};
    dim.T_mount_light = {exp_rotation({kPi, 0, 0}), {0, 0, 6'371'006}};
    s.lights.push_back(dim);
    const Vec3 with = light_along(s, ray, settings, 16).mean;
    EXPECT_GT(without.z, 1);
    for (int band = 0; band < 3; ++band) EXPECT_NEAR(with[band], without[band], 1e-5 * without[band]);
}

TEST(AtmosphereInAScene, SunlightIsThatOfTheColumn) {
    const Scene s = earth_scene(60);
    const AtmosphereMedium medium(s, 2);
    const Vec3 ground{0, 0, 6'371'000};
    const BodyPoses at = placed(s);
    const Rgb through = medium.transmittance(at, {ground, s.sun->direction, 0}, kInfinity);
    const Air air(s.atmosphere->air, 8);
    const Rgb expected =
        transmittance_of(air, columns_along(air, PanelRule(32), ground, s.sun->direction, kInfinity));
    for (const auto& [a, b] : {std::pair{through.x, expected.x}, {through.y, expected.y}, {through.z, expected.z}})
        EXPECT_NEAR(a, b, 2e-3 * static_cast<double>(b));
    EXPECT_LT(medium.transmittance(at, {ground, at_zenith_angle(95, 0), 0}, kInfinity).x, 1e-6f);
}

TEST(AtmosphereInAScene, RaysOfALensAndOfAnExposureAreThoseOfOnePlace) {
    // From points of an aperture, at moments of an exposure, beside each other.
    const Scene s = earth_scene(60);
    const AtmosphereMedium medium(s, 2);
    std::vector<MediumRay> rays;
    for (int i = 0; i < 64; ++i) {
        const double aside = 0.05 * std::sin(1.7 * i), zenith = 75 + 0.1 * (i / 8);
        rays.push_back(
            {{{aside, -aside, 6'371'002}, at_zenith_angle(zenith, 20 + 0.1 * (i % 8)), 1e-4 * i}, kInfinity});
    }
    std::vector<MediumSegment> segments(rays.size());
    medium.along_each(placed(s), rays, segments);
    double most = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
        const MediumSegment exact = medium.along(placed(s), rays[i].ray, kInfinity, 0);
        for (int band = 0; band < 3; ++band) {
            most = std::max(
                most,
                std::abs(static_cast<double>(segments[i].in_scattering[band] / exact.in_scattering[band]) - 1));
            most = std::max(
                most,
                std::abs(static_cast<double>(segments[i].transmittance[band] / exact.transmittance[band]) - 1));
        }
    }
    EXPECT_LT(most, 1.5e-3);
    EXPECT_GT(most, 0);  // interpolated indeed
}

TEST(AtmosphereInAScene, AnAirlessSceneHasNoMedium) {
    Scene s = earth_scene(40);
    s.atmosphere.reset();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    EXPECT_EQ(render_scene->medium(), nullptr);
}

TEST(AtmosphereInAScene, DimsALidarTwice) {
    Scene s = earth_scene(40);
    const auto medium = AtmosphereMedium(s, 2).for_lidar();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Ray beam{{0, 0, 6'371'000 + 3000}, {0, 0, -1}, 0};
    const ShotSettings vacuum{.range_max_m = 1e5};
    ShotSettings air = vacuum;
    air.medium = medium.get();
    const LidarReturn clear = shoot(render_scene->tracer(), placed(s), beam, vacuum);
    const LidarReturn dimmed = shoot(render_scene->tracer(), placed(s), beam, air);
    EXPECT_DOUBLE_EQ(clear.range_m, dimmed.range_m);
    const AirDescription& d = s.atmosphere->air;
    const AirCoefficients c = coefficients(d, 905e-9);
    const double depth = c.gas_scattering * d.gas_height_m * (1 - std::exp(-3000 / d.gas_height_m)) +
                         c.aerosol_extinction * d.aerosol_height_m * (1 - std::exp(-3000 / d.aerosol_height_m));
    EXPECT_NEAR(dimmed.reflectivity / clear.reflectivity, std::exp(-2 * depth), 1e-4);
}

}  // namespace
}  // namespace narpa
