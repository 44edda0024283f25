// What paths leave out, or do with a part of the rays alone, changes no mean.
#include "renderer/integrator/path_integrator.h"
#include "renderer/light/small_body_sampling.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace test;

/// Two plates that face each other a little askew, lit by the Sun from the side.
Scene facing_plates(double sun_diameter_rad) {
    Scene s;
    s.materials = {lambert(0.8f)};
    add_mesh(s, plate(4, 4));
    add_mesh(s, plate(3, 3), looking({1.5, 0, 1.5}, {-1, 0, 0}));
    add_sun(s, {-1, 0.2, 0.6});
    s.sun->angular_diameter_rad = sun_diameter_rad;
    return s;
}

TEST(PathShortcuts, TheLastRayIsSkippedOnlyWhereItFindsNothing) {
    for (const double diameter : {0.0, 0.0093}) {
        Scene dark = facing_plates(diameter), glimmering = dark;
        glimmering.ambient = {1e-20f, 1e-20f, 1e-20f};  // to be looked for, but too faint to count
        const auto unlit = RenderScene::create(dark, 1), all_the_way = RenderScene::create(glimmering, 1);
        ASSERT_TRUE(unlit && all_the_way);
        const BodyPoses at = placed(dark);
        std::uint64_t few = 0, many = 0;
        double sum = 0;
        for (const int depth : {1, 2, 4}) {
            const PathSettings settings{.max_depth = depth};
            for (std::uint32_t pixel = 0; pixel < 64; ++pixel) {
                const Ray ray = ray_to({-1, -3, 2}, {0.02 * pixel - 0.6, 0.1, 0});
                const Hit first = unlit->tracer().intersect(at, ray, kInfinity);
                PathRays rays(1);
                rays.put(0, ray, first, pixel);
                Rgb less, more;
                const auto trace = [&](const RenderScene& render_scene, Rgb& out) {
                    return rays.trace({render_scene, at, settings, 1}, 5, std::span(&out, 1));
                };
                few += trace(*unlit, less);
                many += trace(*all_the_way, more);
                EXPECT_NEAR(less.x, more.x, 1e-6f * more.x + 1e-15f) << depth << ' ' << pixel;
                sum += static_cast<double>(less.x);
            }
        }
        EXPECT_GT(sum, 1e4);
        EXPECT_LT(few, 0.85 * static_cast<double>(many));
    }
}

TEST(PathShortcuts, SamplingASmallBodyFromAMeshKeepsTheMean) {
    // The Sun lights a ball that stands low over a plate, and not the plate itself, whose back is to it.
    Scene s;
    s.materials = {lambert(0.9f)};
    add_mesh(s, plate(4, 4));
    add_sphere(s, 0.2, {0.9, 0, 0.7});
    add_sun(s, {-1, 0, -0.1});
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    EXPECT_TRUE(SmallBodySampling::may_help(render_scene->tracer(), at));
    const Ray ray = ray_to({-1, 0.1, 2}, {-1.1, 0, 0});
    const PathSettings guided{.max_depth = 2}, left_to_chance{.max_depth = 2, .small_bodies = false};
    const Estimate with = light_along(*render_scene, at, ray, guided, 1024, 3);
    const Estimate without = light_along(*render_scene, at, ray, left_to_chance, 8192, 4);
    ASSERT_GT(with.mean.x, 0);
    EXPECT_LT(with.error, 0.01 * with.mean.x);
    EXPECT_NEAR(with.mean.x, without.mean.x, kSigmas * std::hypot(with.error, without.error));
}

TEST(PathShortcuts, SunlightIsSeparateOnlyWhereSomeBodyIsShadedFlat) {
    for (const bool smooth : {false, true}) {
        Scene s;
        s.materials = {lambert(0.9f)};
        add_mesh(s, icosphere(2, 1, smooth));
        add_sun(s, {0, 0, 1});
        EXPECT_EQ(SunPathIntegrator::suffices(*RenderScene::create(s, 1)), !smooth);
        add_sphere(s, 1, {0, 0, 5});
        EXPECT_TRUE(SunPathIntegrator::suffices(*RenderScene::create(s, 1)));
    }
}

TEST(PathShortcuts, SmallBodiesAreNotSampledWhereThereAreNone) {
    Scene s;
    s.materials = {lambert(0.9f)};
    add_mesh(s, plate(4, 4));
    add_mesh(s, plate(4, 4), {{}, {0, 0, 1}});
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    BodyPoses at = placed(s);
    EXPECT_FALSE(SmallBodySampling::may_help(render_scene->tracer(), at));
    at.set(1, {{}, {0, 0, 100}});
    EXPECT_TRUE(SmallBodySampling::may_help(render_scene->tracer(), at));
}

}  // namespace
}  // namespace narpa
