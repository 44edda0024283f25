// Returns that are shaded side by side against those of shots one by one.
#include <gtest/gtest.h>

#include <random>

#include "renderer/lidar/lidar_shot.h"
#include "renderer/light/render_scene.h"
#include "renderer/material/texture/texture_lookup.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/renderer/material/texture_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

Material glossy(float diffuse, float specular, float exponent) {
    Material m = lambert(diffuse);
    m.kind = &kinds::phong;
    m.specular = {specular, 0.5f * specular, 0.25f * specular};
    m.exponent = exponent;
    return m;
}

/// A ball of each of these materials, side by side.
Scene balls() {
    Scene s;
    s.textures.push_back(make(16, 8, [](int x, int y) { return 0.05 * ((3 * x + 5 * y) % 20); }));
    s.materials = {lambert(0.6f), glossy(0.3f, 0.4f, 40), glossy(0.5f, 0, 1), glossy(0.1f, 0.8f, 2000),
                   lambert(0.9f), glossy(0.2f, 0.3f, 7),  lambert(0.5f),      lambert(0.4f)};
    s.materials[2].retroreflectance = 3;
    s.materials[4].texture = s.materials[5].texture = 0;
    s.materials[6].kind = &kinds::lommel_seeliger;
    s.materials[7].texture = s.materials[7].emission_texture = 0;
    for (std::size_t i = 0; i < s.materials.size(); ++i)
        add_sphere(s, 1, {2.1 * static_cast<double>(i), 0, 10}, static_cast<int>(i));
    add_sun(s, {0.3, 0.2, -1});
    return s;
}

/// Shots whose velocities are wanted are shaded one by one.
TEST(LidarReturns, AreToTheBitThoseOfSingleShots) {
    const Scene scene = balls();
    const auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(scene);
    const std::vector<Motion> still(scene.bodies.size());
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> across(-1.05, 15.75), up(-1.05, 1.05);
    std::vector<int> met(scene.bodies.size());
    for (int k = 0; k < 400; ++k) {
        RayBatch beams;
        const double x = across(random);  // every other batch meets one ball or two
        for (beams.n = 0; beams.n < kLanes; ++beams.n)
            beams.put(beams.n,
                      {{}, normalized(Vec3{k % 2 == 0 ? x + 0.1 * up(random) : across(random), up(random), 10})});
        Lanes<LidarReturn> together, single;
        const ShotSettings all{.range_max_m = 18, .sunlight = 0x5a5au};
        ShotSettings moving = all;
        moving.motions = still;
        shoot(render_scene->tracer(), at, beams, all, together);
        shoot(render_scene->tracer(), at, beams, moving, single);
        for (std::size_t i = 0; i < kLanes; ++i) {
            EXPECT_EQ(together[i].range_m, single[i].range_m);
            EXPECT_EQ(together[i].reflectivity, single[i].reflectivity);
            EXPECT_EQ(together[i].body, single[i].body);
            EXPECT_EQ(together[i].cos_incidence, single[i].cos_incidence);
            EXPECT_EQ(together[i].sunlight, single[i].sunlight);
            if (together[i].body >= 0) ++met[static_cast<std::size_t>(together[i].body)];
        }
    }
    for (const int n : met) EXPECT_GT(n, 100);
}

/// Where the normals of a smooth mesh turn away from the LiDAR, between its limb and that of the ball it stands
/// for.
TEST(LidarReturns, NoSurfaceReflectsLessThanNothing) {
    Scene scene;
    scene.materials = {lambert(0.5f)};
    scene.materials[0].retroreflectance = 2;
    add_mesh(scene, icosphere(1, 1, true), {{}, {0, 0, 10}});
    const auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(scene);
    const std::vector<Motion> still(scene.bodies.size());
    for (const bool moving : {false, true}) {
        ShotSettings settings{.range_max_m = 18};
        if (moving) settings.motions = still;
        int met = 0, limb = 0;
        for (int k = 0; k < 720; ++k)
            for (int i = 0; i < 40; ++i) {
                const double phi = k * kPi / 360, r = 0.8 + 0.005 * i;
                const LidarReturn seen =
                    shoot(render_scene->tracer(), at,
                          Ray{{}, normalized(Vec3{r * std::cos(phi), r * std::sin(phi), 10})}, settings);
                if (seen.body < 0) continue;
                ++met;
                limb += seen.cos_incidence <= 0;
                EXPECT_GE(seen.reflectivity, 0);
                EXPECT_GE(seen.cos_incidence, 0);
            }
        EXPECT_GT(met, 1000);
        EXPECT_GT(limb, 10);
    }
}

}  // namespace
}  // namespace narpa
