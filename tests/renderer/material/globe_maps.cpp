// Maps of a planet: oceans that glint, clouds that cover, lights of the night, against closed forms.
#include <gtest/gtest.h>

#include "renderer/frame/camera_image.h"
#include "renderer/integrator/shading.h"
#include "tests/renderer/integrator/path_support.h"
#include "tests/renderer/material/texture_support.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kIrradiance = 1361, kCloud = 0.25, kAlbedo = 0.75;
const Vec3 kToSun = normalized(Vec3{1, 0.5, 0.3});

Texture even(double value) {
    return make(4, 2, [=](int, int) { return value; });
}

/// A globe of 1 m with a dark ocean that glints where `ocean` is white.
Scene globe(Texture ocean) {
    Scene s;
    Material m = lambert(0.1f);
    m.kind = &kinds::phong;
    m.specular = {0.5f, 0.4f, 0.3f};
    m.exponent = 20;
    m.specular_texture = 0;
    s.materials.push_back(m);
    s.textures.push_back(std::move(ocean));
    add_sphere(s, 1, {}, 0);
    add_sun(s, kToSun);
    s.sun->angular_diameter_rad = 1e-5;
    return s;
}

/// Radiance of the globe where the ray meets it, by Phong's reflection law.
double expected(const Vec3& n, const Vec3& v, double diffuse, double specular) {
    const double mu0 = dot(n, kToSun);
    if (mu0 <= 0) return 0;
    const double r_v = std::max(0.0, dot(2 * mu0 * n - kToSun, v));
    return kIrradiance * mu0 * (diffuse + specular * 11 * std::pow(r_v, 20)) / kPi;
}

/// Calls `check(radiance by paths, by direct lighting, normal, direction back)` for places all over the globe.
template <class Check>
void at_places(const Scene& s, const Check& check) {
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(1, 1, 1e5);
    std::mt19937_64 random(5);
    for (int k = 0; k < 60; ++k) {
        const Vec3 n = random_direction(random), eye = 3.0 * normalized(n + 0.5 * random_direction(random));
        const Vec3 path = light_along(*render_scene, placed(s), ray_to(eye, n), kDirectLight, 4).mean;
        RadianceImage image(1, 1);
        FrameSettings settings;
        settings.spp = 1;
        render_radiance(*render_scene, placed(s), c, looking(eye, n), settings, image, nullptr);
        check(path, image.pixels[0], n, normalized(eye - n));
    }
}

TEST(GlobeMaps, TheOceanGlintsWhereItsMapSaysSo) {
    for (const double share : {0.0, 0.6, 1.0})
        at_places(globe(even(share)), [&](const Vec3& path, const Rgb& direct, const Vec3& n, const Vec3& v) {
            const double x = expected(n, v, 0.1, 0.5 * share), z = expected(n, v, 0.1, 0.3 * share);
            EXPECT_NEAR(path.x, x, 2e-3 * x + 1e-3);
            EXPECT_NEAR(static_cast<double>(direct.x), x, 2e-3 * x + 1e-3);
            EXPECT_NEAR(static_cast<double>(direct.z), z, 2e-3 * z + 1e-3);
        });
}

TEST(GlobeMaps, CloudsCoverOceanAndLights) {
    Scene s = globe(even(1));
    Material& m = s.materials[0];
    m.cloud_texture = 1, m.cloud_albedo = {kAlbedo, kAlbedo, kAlbedo};
    m.emission = {4, 2, 1}, m.emission_texture = 2;
    s.textures.push_back(even(kCloud)), s.textures.push_back(even(0.5));
    const double lights = 4 * 0.5 * (1 - kCloud);
    int dark = 0;
    at_places(s, [&](const Vec3& path, const Rgb& direct, const Vec3& n, const Vec3& v) {
        const double x = lights + expected(n, v, 0.1 * (1 - kCloud) + kAlbedo * kCloud, 0.5 * (1 - kCloud));
        EXPECT_NEAR(path.x, x, 2e-3 * x);
        EXPECT_NEAR(static_cast<double>(direct.x), x, 2e-3 * x);
        dark += x == lights ? 1 : 0;
    });
    EXPECT_GT(dark, 10) << "at night the lights are all that there is";
}

TEST(GlobeMaps, CloudsDimTheLightThatFallsOnOthers) {
    const auto on_plate = [](double cloud) {
        Scene s;
        Material m = lambert(0.2f);
        m.emission = {100, 100, 100};
        m.cloud_texture = 0;
        s.materials = {m, lambert(0.5f)};
        s.textures.push_back(even(cloud));
        add_sphere(s, 1, {0, 0, 3}, 0);
        Mesh floor = plate(8, 8);
        floor.face_material.assign(floor.faces.size(), 1);
        add_mesh(s, floor);
        return light_along(s, ray_to({3, 0, 2}, {0.2, 0.1, 0}), kDirectLight, 64).mean.x;
    };
    const double clear = on_plate(0);
    EXPECT_GT(clear, 1);
    EXPECT_NEAR(on_plate(0.75), 0.25 * clear, 1e-4 * clear);
}

}  // namespace
}  // namespace narpa
