// What narpa's speed is measured against must be right itself: Embree's bare calls see the frame's own rays, and
// the plain loop converges to narpa's image.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "bench/budget_ladder.h"
#include "bench/embree/raw_embree.h"
#include "bench/embree/reference_loop.h"
#include "emulator/world.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

/// A scene that ships, through its first camera, so many pixels a side.
std::unique_ptr<World> shipped(const std::string& file, int size, RenderSettings::Method method) {
    auto scene = read_scene(test::build_path("scenes/") + file);
    EXPECT_TRUE(scene) << scene.error().text();
    scene->render.method = method;
    Camera& c = scene->cameras[0];
    const double k = static_cast<double>(size) / c.width;
    c = scaled(c, k, k);
    c.width = c.height = size;
    auto world = World::create(*std::move(scene));
    EXPECT_TRUE(world) << world.error().text();
    return *std::move(world);
}
std::unique_ptr<World> craft(int size, RenderSettings::Method method) {
    return shipped("craft/craft.toml", size, method);
}

struct View {
    explicit View(const World& world) : at(world.scene().bodies.size()) {
        const Camera& c = world.scene().cameras[0];
        world.place(0, c.mount, at);
        T_world_camera = world.sensor_pose(c.mount, c.T_mount_camera, at);
    }
    BodyPoses at;
    Rigid3 T_world_camera;
};

TEST(BenchReference, TheCraftHasItsTrianglesAndItsCover) {
    const auto world = craft(1024, RenderSettings::Method::direct);
    EXPECT_NEAR(static_cast<double>(world->tracer().triangle_count()), 200'000, 2'000);
    const View v(*world);
    auto raw = raw_embree(world->scene(), v.at);
    ASSERT_TRUE(raw);
    const RawCost cost =
        (*raw)(world->scene().cameras[0], v.T_world_camera, normalized(world->scene().sun->direction));
    EXPECT_EQ(cost.primaries, 1024u * 1024u);
    EXPECT_NEAR(static_cast<double>(cost.hits) / static_cast<double>(cost.primaries), 0.27, 0.02);
    EXPECT_GT(cost.shadow_rays, cost.hits / 2);       // most of what is seen faces the Sun
    EXPECT_GT(cost.shadowed, cost.shadow_rays / 20);  // some of it in the craft's own shadow
    EXPECT_GT(cost.primary_s, 0);
    EXPECT_GT(cost.shadow_s, 0);
}

TEST(BenchReference, EmbreesCallsSeeTheSamePixelsAsTheTracer) {
    const auto world = craft(96, RenderSettings::Method::direct);
    const View v(*world);
    const Camera& c = world->scene().cameras[0];
    auto raw = raw_embree(world->scene(), v.at);
    ASSERT_TRUE(raw);
    const RawCost cost = (*raw)(c, v.T_world_camera, normalized(world->scene().sun->direction));
    RadianceImage image(96, 96);
    Aovs aovs;
    render_radiance(world->render_scene(), v.at, c, v.T_world_camera, {}, image, &aovs);
    std::uint64_t seen = 0, lit = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        seen += aovs.body[i] >= 0;
        lit += mean_band(image.pixels[i]) > 0;
    }
    // Rays in single precision pass an edge on the other side in a pixel or two of a thousand.
    EXPECT_NEAR(static_cast<double>(cost.hits), static_cast<double>(seen), 5);
    EXPECT_NEAR(static_cast<double>(cost.shadow_rays - cost.shadowed), static_cast<double>(lit),
                0.02 * static_cast<double>(lit));
}

/// Converged images of both, which must be the same: of the bias, in parts of narpa's mean, at most 4.5 `precision`
/// passes, that is the bound and 3.5 standard errors of at most as much.
void expect_same_image(const World& world, int spp, double precision) {
    const View v(world);
    const Camera& c = world.scene().cameras[0];
    auto loop = reference_loop(world.scene(), v.at);
    ASSERT_TRUE(loop) << loop.error().text();
    FrameSettings settings;
    settings.method = world.scene().render.method;
    settings.max_depth = 5;
    settings.spp = spp;
    RadianceImage image(c.width, c.height);
    ImageMean narpas(image.pixels.size());
    for (settings.frame = 0; settings.frame < 16; ++settings.frame) {
        render_radiance(world.render_scene(), v.at, c, v.T_world_camera, settings, image);
        narpas.add(image.pixels);
    }
    ErrorAgainst loops(narpas);
    for (settings.frame = 0; settings.frame < 16; ++settings.frame) {
        EXPECT_GT((*loop)(c, v.T_world_camera, settings, image), image.pixels.size());
        loops.add(image.pixels);
    }
    const ErrorRow row = loops.row(spp);
    const double level = narpas.level().value;
    // Sixteen pictures each: Student's t of 15 degrees stays below 3.5 but for 0.3 % of all cases.
    EXPECT_LT(std::abs(row.bias.value), precision * level + 3.5 * row.bias.standard_error);
    EXPECT_LT(row.bias.standard_error, precision * level) << "too noisy to tell";
    // What pixels are off beyond noise, which RMSE at this spp would hide.
    EXPECT_LT(row.pixel_bias_squared.value,
              std::pow(0.01 * level, 2) + 3.5 * row.pixel_bias_squared.standard_error);
}

TEST(BenchReference, ThePlainLoopConvergesToTheSameDirectLight) {
    expect_same_image(*craft(40, RenderSettings::Method::direct), 144, 0.0005);
}

TEST(BenchReference, ThePlainLoopConvergesToTheSameFourBounces) {
    expect_same_image(*craft(32, RenderSettings::Method::path), 144, 0.001);
}

TEST(BenchReference, ThePlainLoopConvergesToTheSameLampLight) {
    expect_same_image(*shipped("cornell/cornell.toml", 16, RenderSettings::Method::path), 256, 0.002);
}

TEST(BenchReference, TheLoopRejectsScenesItCannotRender) {
    auto scene = read_scene(test::build_path("scenes/docking/docking.toml"));
    ASSERT_TRUE(scene);
    const BodyPoses at(scene->bodies.size());
    const auto loop = reference_loop(*scene, at);
    ASSERT_FALSE(loop);
    EXPECT_NE(loop.error().what.find("without textures"), std::string::npos) << loop.error().text();
}

}  // namespace
}  // namespace narpa
