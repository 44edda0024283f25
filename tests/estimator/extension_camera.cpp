// The camera joint: poses are estimated through a model that is not in the product as through the pinhole.
#include <gtest/gtest.h>

#include <cmath>

#include "base/constants.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/pnp/pnp.h"
#include "estimator/pnp/pnp_refine.h"
#include "estimator/stereo/stereo_matcher.h"
#include "estimator/view/model_view.h"
#include "renderer/detector/detector.h"
#include "tests/estimator/pnp/pnp_ceres.h"
#include "tests/support/cameras.h"
#include "tests/support/equidistant_camera.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// Points up to 60 degrees off the axis, seen with noise.
class EquidistantPoints : public testing::Test {
protected:
    void see(std::size_t n, double sigma_px) {
        std::uniform_real_distribution<double> u(-1, 1);
        std::normal_distribution<double> normal;
        truth = {random_attitude(random), {0.2, -0.1, 2.5}};
        body_m.clear(), pixels.clear();
        while (body_m.size() < n) {
            const Vec3 p = 2 * Vec3{u(random), u(random), u(random)}, seen = truth * p;
            if (seen.z < 0.5 * norm(seen)) continue;
            const auto image = model->project(seen);
            body_m.push_back(p);
            pixels.push_back({image->x + sigma_px * normal(random), image->y + sigma_px * normal(random)});
        }
    }
    [[nodiscard]] PnpInput input(double sigma_px) const { return {model.get(), body_m, pixels, sigma_px}; }

    std::mt19937_64 random{7};
    const std::shared_ptr<const CameraModel> model = std::make_shared<EquidistantCamera>(500, 480, 640, 500);
    Rigid3 truth;
    std::vector<Vec3> body_m;
    std::vector<Pixel> pixels;
};

TEST_F(EquidistantPoints, PnpFindsThePoseWithoutAGuess) {
    PnpSolver solver(64);
    for (int trial = 0; trial < 20; ++trial) {
        see(40, 1e-6);
        const PnpSolution& exact = solver.solve(input(1));
        ASSERT_TRUE(exact.ok()) << to_text(exact.status);
        EXPECT_LT(error_between(exact.fit.T_camera_body, truth).norm(), 1e-7);
    }
}

TEST_F(EquidistantPoints, PnpErrorsMatchTheirCovarianceAndTheBound) {
    PnpSolver solver(64);
    double nees = 0;
    constexpr int kTrials = 200;
    for (int trial = 0; trial < kTrials; ++trial) {
        see(40, 0.5);
        const PnpSolution& s = solver.solve(input(0.5));
        ASSERT_TRUE(s.ok()) << to_text(s.status);
        nees += normalised_error_squared(error_between(s.fit.T_camera_body, truth), s.fit.covariance) / kTrials;
        const auto bound = pnp_bound(input(0.5), truth);
        ASSERT_TRUE(bound);
        EXPECT_NEAR(position_sigma(s.fit.covariance), position_sigma(*bound), 0.05 * position_sigma(*bound));
    }
    EXPECT_NEAR(nees, 6, 4 * std::sqrt(12.0 / kTrials));
}

TEST_F(EquidistantPoints, CeresAgreesAndOutliersAreFound) {
    PnpSolver solver(64);
    see(40, 0.5);
    const PnpFit ours = solver.solve(input(0.5)).fit;
    const PnpFit theirs = refine_with_ceres(input(0.5), truth);
    ASSERT_TRUE(theirs.ok());
    // Ours weighs residuals as they are at the measured pixels: the same to first order in the noise.
    EXPECT_LT(normalised_error_squared(error_between(ours.T_camera_body, theirs.T_camera_body), ours.covariance),
              1e-3);

    for (std::size_t i = 0; i < pixels.size(); i += 4) pixels[i] = {900, 100 + 10 * static_cast<double>(i)};
    const PnpSolution& s = solver.solve(input(0.5), true);
    ASSERT_TRUE(s.ok()) << to_text(s.status);
    EXPECT_NEAR(static_cast<double>(s.inliers), 30, 2);
    EXPECT_LT(error_between(s.fit.T_camera_body, truth).norm(), 0.02);
}

TEST_F(EquidistantPoints, PixelsWhoseRaysPointBackwardsAreRejected) {
    see(10, 0.5);
    pixels[3] = {640 + 500 * 1.7, 500};
    EXPECT_EQ(PnpSolver(64).solve(input(0.5)).status, PnpStatus::behind_camera);
}

/// The product's lenses: errors match their covariance and the bound as for a pinhole; a pinhole's model of the
/// same image is wrong, and the residuals show it.
TEST(DistortedPoints, PnpErrorsMatchTheBoundAndIgnoringTheLensDoesNot) {
    const Pinhole pinhole{500, 500, 320, 240};
    constexpr int kTrials = 200;
    constexpr double kSigma_px = 0.3;
    for (const auto& model : {test::brown_conrady(pinhole, {-0.25, 0.06, 1e-3, -5e-4}),
                              test::kannala_brandt(pinhole, {-0.02, 0.005, -0.003, 4e-4})}) {
        PnpSolver solver(64);
        std::mt19937_64 random(11);
        std::uniform_real_distribution<double> u(-1, 1);
        std::normal_distribution<double> normal;
        double nees = 0, over_bound = 0, ignored = 0;
        for (int trial = 0; trial < kTrials; ++trial) {
            const Rigid3 truth{random_attitude(random), {0.2, -0.1, 3.5}};
            std::vector<Vec3> body_m;
            std::vector<Pixel> pixels;
            while (body_m.size() < 40) {
                const Vec3 p = 1.4 * Vec3{u(random), u(random), u(random)};
                const auto image = model->project(truth * p);
                if (!image) continue;
                body_m.push_back(p);
                pixels.push_back({image->x + kSigma_px * normal(random), image->y + kSigma_px * normal(random)});
            }
            const PnpInput input{model.get(), body_m, pixels, kSigma_px};
            const PnpSolution& s = solver.solve(input);
            ASSERT_TRUE(s.ok()) << to_text(s.status);
            const auto bound = pnp_bound(input, truth);
            ASSERT_TRUE(bound);
            const Vector6 error = error_between(s.fit.T_camera_body, truth);
            nees += normalised_error_squared(error, s.fit.covariance) / kTrials;
            over_bound += normalised_error_squared(error, *bound) / kTrials;
            const PnpSolution& without = solver.solve({&pinhole, body_m, pixels, kSigma_px});
            if (!without.ok()) continue;
            ignored += normalised_error_squared(error_between(without.fit.T_camera_body, truth), *bound) / kTrials;
        }
        EXPECT_NEAR(nees, 6, 4 * std::sqrt(12.0 / kTrials));
        EXPECT_NEAR(over_bound, 6, 4 * std::sqrt(12.0 / kTrials));
        EXPECT_GT(ignored, 1000);
    }
}

/// A bumpy body 30 degrees off the axis of a wide camera.
class EquidistantFrame : public testing::Test {
protected:
    void SetUp() override {
        auto made = RenderScene::create(scene);
        ASSERT_TRUE(made);
        render_scene.emplace(std::move(*made));
        camera.format = PixelFormat::y16;
        camera = with_equidistant(camera, 170);
        truth = {normalized(Quat{0.8, 0.3, -0.2, 0.4}), 4.0 * Vec3{std::sin(0.5), 0.1, std::cos(0.5)}};
        at = placed(scene);
        ModelView view(*render_scene, camera, 0, at);
        FrameSettings settings;
        settings.spp = 64;
        settings.seed = 5;
        view.render(truth, settings, false);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(camera, view.radiance(), 3, 1, bytes);
        auto image = measured_image(camera, bytes);
        ASSERT_TRUE(image);
        frame = std::move(*image);
    }
    [[nodiscard]] Rigid3 guess() const {
        Vector6 e;
        e << 2 * kRadPerDeg * Eigen::Vector3d(0.6, -0.5, 0.62), 0.08 * Eigen::Vector3d(-0.5, 0.4, 0.7);
        return displaced(truth, e);
    }
    void expect_truth(const Rigid3& T, double rad, double m) const {
        const Vector6 error = error_between(truth, T);
        EXPECT_LT(error.head<3>().norm(), rad);
        EXPECT_LT(error.tail<3>().norm(), m);
    }

    const Scene scene = sunlit_bumpy_body();
    Camera camera = test::camera(200, 160, 1);
    std::optional<RenderScene> render_scene;
    BodyPoses at{1};
    Rigid3 truth;
    MeasuredImage frame;
};

TEST_F(EquidistantFrame, DenseAlignmentFindsThePose) {
    DenseAlignment dense(*render_scene, camera, 0);
    const auto e = dense.align(frame, at, guess(), {});
    ASSERT_TRUE(e) << e.error().text();
    EXPECT_EQ(e->status, DenseStatus::converged) << name(e->status);
    expect_truth(e->T_camera_body, 0.1 * kRadPerDeg, 4e-3);
}

TEST_F(EquidistantFrame, FeatureAlignmentFindsThePose) {
    FeatureAlignment features(*render_scene, camera, 0, at);
    const FeatureEstimate e = features.align(frame, at, guess());
    EXPECT_TRUE(e.answer.usable()) << e.answer.why;
    expect_truth(e.T_camera_target, 0.3 * kRadPerDeg, 0.02);
}

TEST(EquidistantStereo, TriangulatesAndMatchesNothingInTheDark) {
    StereoPair pair{with_equidistant(camera(400, 300, 1), 150), with_equidistant(camera(400, 300, 1), 150), {}};
    pair.T_right_left = {exp_rotation({0.02, -0.1, 0.03}), {-1, 0.1, 0.2}};
    const Vec3 point{3, -2, 4};
    const auto left = pair.left.model->project(point), right = pair.right.model->project(pair.T_right_left * point);
    const Eigen::Matrix2d C = 0.01 * Eigen::Matrix2d::Identity();
    const TriangulatedPoint p = triangulate(pair, {{left->x, left->y}, C}, {{right->x, right->y}, C});
    EXPECT_EQ(p.status, TriangulationStatus::good);
    EXPECT_LT((p.point_m - to_eigen(point)).norm(), 1e-6);
    EXPECT_LT(p.epipolar_sigmas, 1e-4);

    const MeasuredImage frame{400, 300, std::vector<float>(400 * 300)};
    const auto matched = match_stereo(pair, frame, frame, {.nearest_m = 1, .farthest_m = 10});
    ASSERT_TRUE(matched) << matched.error().text();
    EXPECT_TRUE(matched->points.empty());
}

}  // namespace
}  // namespace narpa
