// Sunlight that grazes a planet's air on its way to a body above it, against the columns integrated numerically.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/light/atmosphere.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace narpa::test;

constexpr double kSunsetPlanet_m = 6'371'000;
constexpr double kSunsetHeights_m[]{61e3, 100e3, 400e3, 2e6, 36e6};
constexpr double kTangentHeights_m[]{1e3, 3e3, 8e3, 15e3, 25e3, 40e3, 55e3};

/// An Earth with the Sun along -x, which grazes the planet on its way to bodies at x > 0.
Scene sunset_earth() {
    Scene s;
    s.materials = {lambert(0), lambert(0.5f)};
    add_sphere(s, kSunsetPlanet_m, {});
    add_sun(s, {-1, 0, 0});
    s.sun->angular_diameter_rad = 0;
    s.atmosphere.emplace();
    s.atmosphere->air = earth_air();
    s.atmosphere->samples_per_band = 1;
    return s;
}

/// The place at a height above the ground from which the Sun's light comes past the ground at a tangent height.
Vec3 sunset_place(double height_m, double tangent_m) {
    const double r = kSunsetPlanet_m + height_m, across = kSunsetPlanet_m + tangent_m;
    return {std::sqrt((r - across) * (r + across)), 0, across};
}

/// Columns from a place towards -x, by the midpoint rule.
AirColumns sunset_columns(const AirDescription& air, const Vec3& place) {
    constexpr int kSteps = 40'000;
    const double top = air.ground_radius_m + air.top_m, half = std::sqrt((top - place.z) * (top + place.z));
    const double length = std::min(place.x, half) + half, step = length / kSteps;
    double gas = 0, aerosol = 0, ozone = 0;
    for (int i = 0; i < kSteps; ++i) {
        const double x = (i + 0.5) * step - half;
        const double height = x * x / (std::hypot(x, place.z) + place.z) + (place.z - air.ground_radius_m);
        gas += step * std::exp(-height / air.gas_height_m);
        aerosol += step * std::exp(-height / air.aerosol_height_m);
        ozone += air.ozone_du > 0 ? step * static_cast<double>(Air::ozone_density(static_cast<float>(height))) : 0;
    }
    return {static_cast<float>(gas), static_cast<float>(aerosol), static_cast<float>(ozone)};
}

TEST(OrbitalSunset, IsDimmedByTheWholeColumn) {
    const Scene s = sunset_earth();
    const AtmosphereMedium medium(s, 2);
    const Air air(s.atmosphere->air, s.atmosphere->samples_per_band);
    const BodyPoses at = placed(s);
    for (const double height : kSunsetHeights_m)
        for (const double tangent : kTangentHeights_m) {
            const Vec3 place = sunset_place(height, tangent);
            const Rgb through = medium.transmittance(at, {place, {-1, 0, 0}, 0}, kInfinity);
            const Rgb expected = transmittance_of(air, sunset_columns(s.atmosphere->air, place));
            for (int band = 0; band < 3; ++band)
                EXPECT_NEAR(through[band], expected[band], 1e-3) << height << " " << tangent << " " << band;
        }
}

TEST(OrbitalSunset, HasNoStepAtTheTopOfTheAir) {
    const Scene s = sunset_earth();
    const AtmosphereMedium medium(s, 2);
    const Air air(s.atmosphere->air, s.atmosphere->samples_per_band);
    const double top = s.atmosphere->air.top_m;
    for (const double height : {top - 1000, top - 10, top - 0.01, top, top + 0.01, top + 10})
        for (const double tangent : kTangentHeights_m) {
            const Vec3 place = sunset_place(height, tangent);
            const Rgb through = medium.transmittance(placed(s), {place, {-1, 0, 0}, 0}, kInfinity);
            const Rgb expected = transmittance_of(air, sunset_columns(s.atmosphere->air, place));
            for (int band = 0; band < 3; ++band)
                EXPECT_NEAR(through[band], expected[band], 0.01) << height << " " << tangent << " " << band;
        }
}

TEST(OrbitalSunset, LightThatMissesTheAirIsWholeAndBehindTheGroundIsNone) {
    const Scene s = sunset_earth();
    const AtmosphereMedium medium(s, 2);
    const BodyPoses at = placed(s);
    for (const double height : kSunsetHeights_m) {
        const Vec3 clear = sunset_place(height, std::min(60'500.0, height - 1));
        EXPECT_EQ(medium.transmittance(at, {clear, {-1, 0, 0}, 0}, kInfinity).z, 1) << height;
        EXPECT_EQ(medium.transmittance(at, {sunset_place(height, 1e3), {1, 0, 0}, 0}, kInfinity).z, 1) << height;
        EXPECT_LT(medium.transmittance(at, {sunset_place(height, -2e3), {-1, 0, 0}, 0}, kInfinity).x, 1e-6f);
    }
}

TEST(OrbitalSunset, IsSeenByBothMethods) {
    for (const double height : {100e3, 36e6}) {
        Scene s = sunset_earth();
        const Vec3 place = sunset_place(height, 12e3);
        Mesh panel = plate(2, 2);
        panel.face_material.assign(panel.faces.size(), 1);
        add_mesh(s, panel, {exp_rotation({0, -kPi / 2, 0}), place});
        const Air air(s.atmosphere->air, s.atmosphere->samples_per_band);
        const Rgb expected = transmittance_of(air, sunset_columns(s.atmosphere->air, place));
        const Ray view = ray_to(place + Vec3{-5, 1, 1}, place);
        const auto render_scene = RenderScene::create(s, 1);
        ASSERT_TRUE(render_scene);
        for (const bool direct : {true, false}) {
            const Vec3 seen =
                light_along(*render_scene, placed(s), view, {.max_depth = 4, .direct = direct}, 4).mean;
            const double white = 0.5 / kPi * s.sun->irradiance_w_m2;
            for (int band = 0; band < 3; ++band)
                EXPECT_NEAR(seen[band] / white, expected[band], 2e-3) << height << " " << direct << " " << band;
        }
    }
}

TEST(OrbitalSunset, DimsTheSunlightThatALidarSees) {
    const Scene s = sunset_earth();
    const auto medium = AtmosphereMedium(s, 2).for_lidar();
    const AirCoefficients c = coefficients(s.atmosphere->air, 905e-9);
    for (const double height : kSunsetHeights_m)
        for (const double tangent : kTangentHeights_m) {
            const Vec3 place = sunset_place(height, tangent);
            const AirColumns air = sunset_columns(s.atmosphere->air, place);
            const double expected = std::exp(-(c.gas_scattering * static_cast<double>(air.gas) +
                                               c.aerosol_extinction * static_cast<double>(air.aerosol) +
                                               c.ozone_absorption * static_cast<double>(air.ozone)));
            EXPECT_NEAR(medium->transmittance(placed(s), {place, {-1, 0, 0}, 0}, kInfinity), expected, 1e-3);
        }
}

}  // namespace
}  // namespace narpa
