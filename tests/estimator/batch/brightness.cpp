// Albedo and the direction of the light from the brightness of frames, rendered and exposed.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "tests/estimator/batch/batch_flight.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using U = BatchUnknown;

Camera batch_camera() {
    Camera c = test::camera(320, 240, 400);
    c.format = PixelFormat::y16;
    c.detector = Detector{.exposure_s = 3e-5,
                          .full_well_e = 13500,
                          .read_noise_e = 13,
                          .shot_noise = true,
                          .black_level_dn = 64,
                          .bits = 12};
    return c;
}

/// The body of the flights, lit by the Sun from there.
Scene lit_scene(const Vec3& to_sun, double irradiance_w_m2 = 1361) {
    Scene scene = test::batch_scene();
    test::add_sun(scene, to_sun, irradiance_w_m2);
    return scene;
}

const Vec3 kBatchSun = normalized(Vec3{0.5, -0.6, -1});

/// Frames of the body as it turns before a camera at rest, with points without error.
BatchInput turning_body(const Scene& world, const Scene& model, int frames, std::uint64_t seed) {
    const Camera camera = batch_camera();
    const auto real = RenderScene::create(world), modelled = RenderScene::create(model);
    EXPECT_TRUE(real && modelled);
    BatchInput in;
    in.camera = camera.model;
    const std::vector<Vec3> points{{1.5, 1, 1},  {-1.5, 1, 1},  {1.5, -1, 1}, {-1.5, -1, 1},
                                   {1.5, 1, -1}, {-1.5, 1, -1}, {1.5, -1, -1}};
    for (int k = 0; k < frames; ++k) {
        const Rigid3 T{exp_rotation(0.35 * k * normalized(Vec3{0.6, 1, 0.3})), {0.1, -0.1, 14}};
        BodyPoses at(1);
        at.set(0, T);
        FrameSettings settings;
        settings.spp = 16, settings.seed = seed + std::uint64_t(k);
        ModelView view(*real, camera, 0, at);
        view.render(T, settings, false);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(camera, view.radiance(), seed, std::uint32_t(k), bytes);
        const auto image = measured_image(camera, bytes);
        EXPECT_TRUE(image);
        BatchFrame frame;
        frame.time = {std::llround(1e9 * k), {}, {}, T};
        frame.T_camera_target = T;
        for (const Vec3& p : points) {
            const auto seen = camera.model->project(T * p);
            frame.points.body_m.push_back(p);
            frame.points.seen.push_back({seen->x, seen->y});
            frame.points.noise.push_back({0.01, 0, 0.01}), frame.points.beyond.push_back({1, 0, 1});
            frame.points.numbers.push_back(2);
        }
        settings.spp = 4, settings.seed = 77;
        frame.brightness = observe_brightness(*modelled, camera, 0, at, *image, T, settings);
        in.frames.push_back(std::move(frame));
    }
    return in;
}

BatchOptions brightness_options() {
    return {.has_motion = false, .prior_sigma = test::priors_of({U::albedo, U::light_x, U::light_y})};
}

TEST(LightAxes, ArePerpendicular) {
    for (const Vec3& s :
         {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{1, 0, 0}, kBatchSun, normalized(Vec3{0.1, 0.2, 0.9})}) {
        const auto axes = light_axes(s);
        EXPECT_NEAR(dot(axes[0], s), 0, 1e-15);
        EXPECT_NEAR(dot(axes[1], s), 0, 1e-15);
        EXPECT_NEAR(dot(axes[0], axes[1]), 0, 1e-15);
        EXPECT_NEAR(norm(axes[0]), 1, 1e-15);
        EXPECT_NEAR(norm(axes[1]), 1, 1e-15);
    }
}

/// Blocks on the body only, with the brightness that the frame shows.
TEST(Brightness, BlocksAgreeWithARightModel) {
    const Scene scene = lit_scene(kBatchSun);
    const BatchInput in = turning_body(scene, scene, 1, 5);
    const auto& blocks = in.frames.front().brightness.blocks;
    ASSERT_GT(blocks.size(), 20u);
    for (const BrightnessBlock& b : blocks) {
        EXPECT_NEAR(b.measured, b.model, 0.01 * b.model);
        EXPECT_LT(b.part, BrightnessObservations::kParts);
    }
}

/// Errors of several standard deviations of the priors are found, to the second order of the light's turn.
TEST(Brightness, FindsAlbedoAndLight) {
    BatchValues truth{};
    at(truth, U::albedo) = -0.15, at(truth, U::light_x) = 2.5 * kDegree, at(truth, U::light_y) = -1.5 * kDegree;
    const auto axes = light_axes(kBatchSun);
    const Vec3 turned = exp_rotation(at(truth, U::light_x) * axes[0] + at(truth, U::light_y) * axes[1]) * kBatchSun;
    const BatchInput in = turning_body(lit_scene(turned, 0.85 * 1361), lit_scene(kBatchSun), 8, 6);
    const auto result = solve_batch(in, brightness_options());
    ASSERT_TRUE(result) << result.error().text();
    EXPECT_TRUE(result->settled);
    ASSERT_EQ(result->unknowns.size(), 3u);
    for (const BatchEstimate& e : result->unknowns) {
        EXPECT_TRUE(e.is_determined);
        EXPECT_NEAR(e.value, at(truth, e.unknown), 4 * e.sigma) << batch_unknowns()[std::size_t(e.unknown)].name;
    }
    EXPECT_LT(test::of(*result, U::light_x).sigma, 0.05 * kDegree);
    EXPECT_LT(test::of(*result, U::albedo).sigma, 0.002);
    EXPECT_EQ(result->residuals.size(), 16u) << "points and brightness of each frame";
    EXPECT_EQ(result->residuals.back().measure, BatchMeasure::brightness);
}

TEST(Brightness, CovarianceIsConsistent) {
    const BatchOptions options = brightness_options();
    constexpr int kRuns = 12;
    double nees = 0;
    for (int k = 0; k < kRuns; ++k) {
        std::mt19937_64 random(60 + std::uint64_t(k));
        std::normal_distribution<double> normal;
        BatchValues truth{};
        for (const U u : {U::albedo, U::light_x, U::light_y})
            at(truth, u) = at(options.prior_sigma, u) * normal(random);
        const auto axes = light_axes(kBatchSun);
        const Vec3 turned =
            exp_rotation(at(truth, U::light_x) * axes[0] + at(truth, U::light_y) * axes[1]) * kBatchSun;
        const BatchInput in = turning_body(lit_scene(turned, (1 + at(truth, U::albedo)) * 1361),
                                           lit_scene(kBatchSun), 4, 200 + std::uint64_t(k));
        const auto result = solve_batch(in, options);
        ASSERT_TRUE(result) << result.error().text();
        nees += test::unknowns_nees(*result, truth) / kRuns;
    }
    EXPECT_LT(nees, 3 + 3 * std::sqrt(6.0 / kRuns));
    EXPECT_GT(nees, 0.5) << "much too cautious";
}

/// Ambient light comes from no direction.
TEST(Brightness, WithoutASunTheLightIsNotDetermined) {
    Scene scene = test::batch_scene();
    scene.ambient = {100, 100, 100};
    const BatchInput in = turning_body(scene, scene, 3, 8);
    ASSERT_FALSE(in.frames.front().brightness.blocks.empty());
    const auto result = solve_batch(in, brightness_options());
    ASSERT_TRUE(result) << result.error().text();
    EXPECT_TRUE(test::of(*result, U::albedo).is_determined);
    EXPECT_FALSE(test::of(*result, U::light_x).is_determined);
    EXPECT_FALSE(test::of(*result, U::light_y).is_determined);
}

}  // namespace
}  // namespace narpa
