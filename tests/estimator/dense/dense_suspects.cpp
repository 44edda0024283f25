// Frames of a world that differs from the model in one thing that is not told: refused, and the suspect is named.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>

#include "estimator/dense/dense_alignment.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "renderer/projection/pinhole.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

/// A bracket of three plates, which light each other, with a mast.
Scene bracket(float albedo) {
    Scene s;
    s.sun = Sun{normalized(Vec3{0.5, -0.45, -0.7}), 1361, 0};
    s.materials.push_back(test::lambert(albedo));
    Mesh mesh;
    test::append_box(mesh, {2, 2, 0.1}, {});
    test::append_box(mesh, {2, 0.1, 1.6}, {{}, {0, 1, 0.75}});
    test::append_box(mesh, {0.1, 2, 1.2}, {{}, {-1, 0, 0.55}});
    test::append_box(mesh, {0.2, 0.2, 1.3}, {exp_rotation({0.3, 0.2, 0}), {0.5, -0.4, 0.6}});
    mesh.face_material.assign(mesh.faces.size(), 0);
    s.meshes.push_back(std::move(mesh));
    Body body;
    body.shape = 0;
    s.bodies.push_back(std::move(body));
    Camera c = test::square_camera(128);
    c.height = 96;
    c.model = std::make_shared<const Pinhole>(200, 200, 63.5, 47.5);
    c.format = PixelFormat::y16;
    s.cameras.push_back(std::move(c));
    return s;
}

class DenseSuspects : public testing::Test {
protected:
    /// Of `world`, seen with its camera and this motion.
    DenseEstimate estimate(const Scene& world, const ApparentMotion& motion = {}, const RenderSettings& how = {},
                           double gain_right = 0) {
        const auto rendered = RenderScene::create(world);
        EXPECT_TRUE(rendered);
        const Camera& exposing = world.cameras.front();
        ModelView view(*rendered, exposing, 0, at);
        view.begin_frame(at, motion, row_times(exposing));
        FrameSettings settings;
        settings.spp = 64, settings.seed = 9, settings.method = how.method;
        view.render(truth, settings, false);
        RadianceImage light = view.radiance();
        for (int y = 0; y < light.height; ++y)
            for (int x = 0; x < light.width; ++x)
                light.pixels[static_cast<std::size_t>(y * light.width + x)] *=
                    static_cast<float>(1 + gain_right * ((x + 0.5) / light.width - 0.5));
        const Camera& camera = model.cameras.front();
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(exposing, light, 3, 0, bytes);
        const auto image = measured_image(camera, bytes);
        EXPECT_TRUE(image);
        const auto known = RenderScene::create(model);
        EXPECT_TRUE(known);
        Vector6 off;
        off << 0.02, -0.015, 0.02, 0.03, -0.02, 0.1;
        auto e = DenseAlignment(*known, camera, 0).align(*image, at, displaced(truth, off), {});
        EXPECT_TRUE(e);
        return *std::move(e);
    }
    /// The answer is refused, and why contains `words`.
    static void expect_refused(const DenseEstimate& e, const std::string& words) {
        EXPECT_EQ(e.answer.kind, AnswerKind::refused);
        EXPECT_NE(e.answer.why.find(words), std::string::npos) << e.answer.why;
    }

    /// The suspect is refused by name, or solved, and then the answer is right.
    void expect_refused_or_solved(const DenseEstimate& e, std::string_view suspect, const std::string& words) {
        if (e.answer.kind == AnswerKind::refused) return expect_refused(e, words);
        EXPECT_TRUE(std::ranges::any_of(
            e.suspicions, [&](const Suspicion& s) { return s.solved && s.suspect->name == suspect; }));
        EXPECT_LT(normalised_error_squared(error_between(truth, e.T_camera_body), e.covariance), 27.9);
    }

    const Scene model = bracket(0.3F);
    const BodyPoses at{1};
    const Rigid3 truth{exp_rotation({2.4, 0.5, -0.3}), {0.1, -0.05, 6}};
};

TEST_F(DenseSuspects, FindNothingInAFrameOfTheModel) {
    const DenseEstimate e = estimate(model);
    EXPECT_EQ(e.answer.kind, AnswerKind::good) << e.answer.why;
    EXPECT_LT(normalised_error_squared(error_between(truth, e.T_camera_body), e.covariance), 27.9);
    ASSERT_FALSE(e.suspicions.empty());
    for (const Suspicion& s : e.suspicions) EXPECT_LT(s.fit.sigmas, 4) << s.suspect->name;
}

TEST_F(DenseSuspects, ARollingShutter) {
    Scene world = model;
    world.cameras.front().shutter = Shutter{100'000};
    expect_refused(estimate(world, {{6, 2, 0}, {}}), "rolling shutter");  // 2 px over the target's rows
}

TEST_F(DenseSuspects, MotionDuringTheExposure) {
    Scene world = model;
    world.cameras.front().shutter = Shutter{};
    expect_refused(estimate(world, {{2500, 0, 0}, {}}), "motion during the exposure");  // 2.5 px
}

TEST_F(DenseSuspects, ALightFromElsewhere) {
    Scene world = model;
    world.sun->direction = exp_rotation({0.05, 0.02, 0}) * world.sun->direction;  // 3 degrees
    expect_refused_or_solved(estimate(world), "light", "lit from elsewhere");
}

TEST_F(DenseSuspects, AmbientLight) {
    Scene world = model;
    world.ambient = {9, 9, 9};  // 2 % of white
    expect_refused_or_solved(estimate(world), "ambient", "ambient light");
}

TEST_F(DenseSuspects, AGainThatChangesAcrossTheImage) {
    expect_refused_or_solved(estimate(model, {}, {}, 0.3), "gain", "gain changes across the image");
}

TEST_F(DenseSuspects, Interreflection) {
    RenderSettings how;
    how.method = RenderSettings::Method::path;
    expect_refused_or_solved(estimate(model, {}, how), "indirect", "light each other");
}

}  // namespace
}  // namespace narpa
