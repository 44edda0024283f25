// Render and compare, dense: from five degrees and five per cent off to the pose of a frame.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <limits>
#include <optional>

#include "base/constants.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/dense/level_view.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

/// The docking scene with the navigation camera at 160 x 120, 25 m before the port.
class DockingFrame : public testing::Test {
protected:
    void SetUp() override {
        auto read = read_scene(test::build_path("scenes/docking/docking.toml"));
        ASSERT_TRUE(read) << read.error().text();
        scene = std::move(*read);
        camera = coarser_camera(scene.cameras[0], 4);
        camera.format = PixelFormat::y16;
        auto made = RenderScene::create(scene);
        ASSERT_TRUE(made);
        render_scene.emplace(std::move(*made));
        for (std::size_t b = 0; b < at.T_world_body.size(); ++b) at.set(b, scene.bodies[b].initial.T_world_body);
        at.T_world_body[1].t = {25, 1.2, -0.8};
        truth = inverse(at.T_world_body[1] * camera.T_mount_camera) * at.T_world_body[0];
    }
    MeasuredImage frame_at(const Rigid3& pose, bool noise) {
        ModelView view(*render_scene, camera, 0, at);
        FrameSettings s;
        s.seed = 99;
        s.budget.kind = FrameBudget::Kind::rays;
        s.budget.rays = 1'000'000;
        view.render(pose, s, false);
        Camera exposing = camera;
        if (!noise) exposing.detector->shot_noise = false, exposing.detector->read_noise_e = 0;
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(exposing, view.radiance(), 3, 1, bytes);
        auto image = measured_image(camera, bytes);
        EXPECT_TRUE(image);
        return std::move(*image);
    }

    Scene scene;
    Camera camera;
    std::optional<RenderScene> render_scene;
    BodyPoses at{2};
    Rigid3 truth;
};

Vector6 off_by(double degrees, double part, double range_m) {
    Vector6 e;
    e << degrees * kRadPerDeg * Eigen::Vector3d(0.6, -0.5, 0.62).normalized(),
        part * range_m * Eigen::Vector3d(-0.5, 0.4, 0.7).normalized();
    return e;
}

TEST_F(DockingFrame, IsFoundFromFiveDegreesAndFivePerCent) {
    const MeasuredImage frame = frame_at(truth, false);
    DenseAlignment dense(*render_scene, camera, 0);
    DenseOptions o;
    o.fineness = 4;
    o.samples_per_pixel = 12;
    const auto e = dense.align(frame, at, displaced(truth, off_by(5, 0.05, norm(truth.t))), o);
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_EQ(e->status, DenseStatus::converged) << name(e->status);
    const Vector6 error = error_between(truth, e->T_camera_body);
    EXPECT_LT(error.head<3>().norm(), 0.02 * kRadPerDeg);
    EXPECT_LT(error.tail<3>().norm(), 1e-3 * norm(truth.t));
}

TEST_F(DockingFrame, RefusesFalseMinima) {
    const MeasuredImage frame = frame_at(truth, true);
    DenseAlignment dense(*render_scene, camera, 0);
    DenseOptions o;
    o.fineness = 3;
    o.samples_per_pixel = 3;
    o.finest = 2;
    o.iterations = 8;
    const auto e = dense.align(frame, at, displaced(truth, off_by(60, 0.1, norm(truth.t))), o);
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_NE(e->status, DenseStatus::converged);
    EXPECT_GT(angle_between(e->T_camera_body.q, truth.q), 10 * kRadPerDeg) << "then it may as well converge";
}

TEST_F(DockingFrame, IsTheSameOnAnyNumberOfThreads) {
    const MeasuredImage frame = frame_at(truth, true);
    DenseOptions o;
    o.fineness = 4;
    o.samples_per_pixel = 3;
    o.finest = 2;
    const auto pose_on = [&](int threads) {
        tbb::task_arena arena(threads);
        return arena.execute([&] {
            const auto e = DenseAlignment(*render_scene, camera, 0)
                               .align(frame, at, displaced(truth, off_by(1, 0.01, norm(truth.t))), o);
            EXPECT_TRUE(e);
            return e ? *e : DenseEstimate{};
        });
    };
    const DenseEstimate one = pose_on(1), three = pose_on(3);
    EXPECT_EQ(one.T_camera_body, three.T_camera_body);
    EXPECT_EQ(one.covariance, three.covariance);
}

TEST_F(DockingFrame, RefusesInvalidInput) {
    const MeasuredImage frame = frame_at(truth, false);
    DenseAlignment dense(*render_scene, camera, 0);
    const auto says = [&](const MeasuredImage& f, const Rigid3& guess, const DenseOptions& o,
                          std::span<const float> variance, const char* words) {
        const auto e = dense.align(f, at, guess, o, variance);
        ASSERT_FALSE(e) << words;
        EXPECT_NE(e.error().what.find(words), std::string::npos) << e.error().what;
    };
    MeasuredImage bad = frame;
    bad.dn[77] = std::numeric_limits<float>::quiet_NaN();
    says(bad, truth, {}, {}, "not finite");
    says({3, 3, std::vector<float>(9)}, truth, {}, {}, "expected the camera's 160 x 120");
    says(frame, {Quat{2, 0, 0, 0}, {}}, {}, {}, "quaternion of norm 1");
    says(frame, truth, {}, std::vector<float>(5), "variances of 5 pixels");
    says(frame, truth, {}, std::vector<float>(frame.dn.size(), -1), "negative");
}

/// Whichever others are rendered, and their variance is about the same.
TEST_F(DockingFrame, ChosenPixelsAreThoseOfTheWholeImage) {
    ModelView view(*render_scene, camera, 0, at);
    FrameSettings s;
    s.spp = 16;
    view.render_with_variance(truth, s);
    const std::vector<Rgb> whole = view.radiance().pixels;
    const std::vector<float> variance = view.aovs().variance;
    std::vector<std::uint8_t> chosen(whole.size());
    for (std::size_t p = 0; p < chosen.size(); ++p) chosen[p] = p % 7 == 0 || p % 160 < 20 ? 1 : 0;
    view.render_with_variance(truth, s, chosen);
    double sum = 0, sum_of_whole = 0;
    int lit = 0;
    for (std::size_t p = 0; p < whole.size(); ++p) {
        if (chosen[p] == 0) continue;
        ASSERT_EQ(view.radiance().pixels[p], whole[p]) << p;
        sum += static_cast<double>(view.aovs().variance[p]), sum_of_whole += static_cast<double>(variance[p]);
        lit += whole[p] == Rgb{} ? 0 : 1;
    }
    EXPECT_GT(lit, 500);
    EXPECT_GT(sum, 0.7 * sum_of_whole);
    EXPECT_LT(sum, 2 * sum_of_whole);
}

/// Pixels of which little is bright: of few samples none may have met that, or one by chance.
TEST_F(DockingFrame, VarianceAllowsForMissedLight) {
    const SensorModel sensor = sensor_model(camera);
    LevelView view(*render_scene, camera, sensor, 1, {0, 0, camera.width, camera.height}, 0, at);
    view.begin_frame(at, {}, row_times(camera), {}, {});
    FrameSettings s;
    s.spp = 16;
    constexpr std::uint64_t kFrames = 100;
    std::vector<std::vector<double>> light, stated;
    for (s.seed = 1; s.seed <= kFrames; ++s.seed) {
        view.render(truth, s);
        view.allow_for_missed_light(s.spp);
        const PhotometricImages images = view.images();
        light.emplace_back(images.signal.begin(), images.signal.end());
        stated.emplace_back(images.signal_variance.begin(), images.signal_variance.end());
    }
    std::vector<double> mean(light.front().size());
    for (const auto& frame : light)
        for (std::size_t p = 0; p < mean.size(); ++p) mean[p] += frame[p] / kFrames;
    double squares = 0, most = 0;
    int pixels = 0;
    for (int y = 1; y < camera.height - 1; ++y)
        for (int x = 1; x < camera.width - 1; ++x) {
            const auto at_pixel = [&](int dx, int dy) {
                return static_cast<std::size_t>((y + dy) * camera.width + x + dx);
            };
            const std::size_t p = at_pixel(0, 0);
            double dark = mean[p], bright = mean[p];
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx)
                    dark = std::min(dark, mean[at_pixel(dx, dy)]),
                    bright = std::max(bright, mean[at_pixel(dx, dy)]);
            const double bright_samples = s.spp * (mean[p] - dark) / std::max(bright - dark, 1e-9);
            if (dark > 0.5 * bright || bright_samples < 0.1 || bright_samples > 4) continue;
            ++pixels;
            for (std::size_t k = 0; k < kFrames; ++k) {
                const double square = std::pow(light[k][p] - mean[p], 2) / stated[k][p];
                squares += square / kFrames, most = std::max(most, square);
            }
        }
    ASSERT_GT(pixels, 50);
    EXPECT_LT(squares / pixels, 0.8);  // measured 0.44; by the samples' own variance infinite
    EXPECT_LT(most, 150);              // 74
}

/// Where the target covers more than 10,000 pixels, those that hold the pose make the last steps.
TEST_F(DockingFrame, OfManyPixelsIsFoundByInformativePixels) {
    camera = scene.cameras[0];
    camera.format = PixelFormat::y16;
    at.T_world_body[1].t = {15, 0.7, -0.5};
    truth = inverse(at.T_world_body[1] * camera.T_mount_camera) * at.T_world_body[0];
    ModelView view(*render_scene, camera, 0, at);
    FrameSettings s;
    s.seed = 99;
    s.spp = 64;
    view.render_with_variance(truth, s);
    std::vector<std::uint8_t> bytes(frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
    expose(camera, view.radiance(), 3, 1, bytes);
    const auto& k = sensor_model(camera).dn_per_radiance;
    std::vector<float> variance;
    for (const float v : view.aovs().variance)
        variance.push_back(v * static_cast<float>(std::pow(k[0] + k[1] + k[2], 2)));
    DenseAlignment dense(*render_scene, camera, 0);
    const auto e = dense.align(*measured_image(camera, bytes), at, displaced(truth, off_by(1, 0.01, norm(truth.t))),
                               {}, variance);
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_GT(e->pixels, 10'000U);
    EXPECT_GT(e->chosen, e->pixels / 50);
    EXPECT_LT(e->chosen, e->pixels / 4);
    EXPECT_EQ(e->answer.kind, AnswerKind::good) << e->answer.why;
    const Vector6 error = error_between(truth, e->T_camera_body);
    EXPECT_LT(normalised_error_squared(error, e->covariance), 27.9);  // one of 10,000 right ones is larger
    EXPECT_LT(error.head<3>().norm(), 1e-3 * kRadPerDeg);
    EXPECT_LT(error.tail<3>().norm(), 5e-5 * norm(truth.t));
}

TEST_F(DockingFrame, ReportsThatTheTargetIsOutsideTheImage) {
    const MeasuredImage frame = frame_at(truth, false);
    DenseAlignment dense(*render_scene, camera, 0);
    for (const Vec3& place : {Vec3{500, 0, 60}, Vec3{0, 0, -60}}) {
        const auto e = dense.align(frame, at, {truth.q, place}, {});
        ASSERT_TRUE(e);
        EXPECT_EQ(e->status, DenseStatus::left_the_picture);
        EXPECT_FALSE(dense.bound(at, {truth.q, place}, {}));
    }
}

}  // namespace
}  // namespace narpa
