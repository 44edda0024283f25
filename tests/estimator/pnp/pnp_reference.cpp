// The refinement beside Ceres's, and the bound beside what errors do.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "estimator/least_squares/levenberg_marquardt.h"
#include "estimator/pnp/pnp_refine.h"
#include "tests/estimator/pnp/pnp_ceres.h"
#include "tests/estimator/pnp/pnp_support.h"

namespace narpa {
namespace {

class PnpReference : public testing::Test {
protected:
    std::mt19937_64 random_{21};
    PnpRefiner refiner_{128};
};

TEST_F(PnpReference, EndsWhereCeresEnds) {
    for (const Loss kind : {Loss::none, Loss::cauchy}) {
        for (const std::size_t n : {12u, 25u}) {
            for (int trial = 0; trial < 10; ++trial) {
                const Rigid3 truth{test::random_attitude(random_), {0.4, -0.1, 18}};
                test::Seen seen = test::see(random_, test::random_points(random_, n, 2), truth, 0.5);
                if (kind != Loss::none) seen.pixels[0].u += 20;
                std::vector<PixelCovariance> covariances(n, {0.3, 0.1, 0.2});
                covariances[1] = {2, -1, 1};
                PnpInput input = seen.input();
                input.covariance_px2 = covariances;
                RefineOptions options;
                options.loss = {kind, 3};
                options.lm.step_sigma = 1e-6;
                options.lm.chi2_settled = 0;
                options.lm.iterations_max = 200;
                const Rigid3 start = test::pose_off_by(random_, truth, 0.0005, 0.0001);
                const PnpFit& ours = refiner_.refine(input, start, options);
                ASSERT_TRUE(ours.ok()) << to_text(ours.status);
                // Ceres stops where the cost changes by less than 1e-6 of itself, which may be early.
                EXPECT_LE(ours.chi2, refine_with_ceres(input, start, options.loss).chi2 * (1 + 1e-9));
                const PnpFit theirs = refine_with_ceres(input, ours.T_camera_body, options.loss);
                ASSERT_TRUE(theirs.ok()) << to_text(theirs.status);
                EXPECT_NEAR(ours.chi2, theirs.chi2, 1e-6 * theirs.chi2);
                EXPECT_LT(normalised_error_squared(error_between(ours.T_camera_body, theirs.T_camera_body),
                                                   ours.covariance),
                          1e-3);
                EXPECT_LT((ours.covariance - theirs.covariance).norm(), 0.02 * ours.covariance.norm());
                EXPECT_NEAR(theirs.summary.costs().back(), theirs.chi2, 1e-6 * theirs.chi2);
            }
        }
    }
}

TEST_F(PnpReference, CeresRefusesWhatTheRefinementRefuses) {
    const Rigid3 truth{{}, {0, 0, 10}};
    test::Seen seen = test::see(random_, test::random_points(random_, 6, 1), truth, 0.5);
    EXPECT_EQ(refine_with_ceres(seen.input(), {{}, {0, 0, -10}}).status, PnpStatus::behind_camera);
    EXPECT_EQ(refine_with_ceres(seen.input(), {{0, 0, 0, 0}, {0, 0, 10}}).status, PnpStatus::not_finite);
    seen.pixels[0].u = std::numeric_limits<double>::quiet_NaN();
    EXPECT_EQ(refine_with_ceres(seen.input(), truth).status, PnpStatus::not_finite);
}

TEST_F(PnpReference, BoundIsTheCovarianceAtTheTruth) {
    for (const double range_m : {4., 40.}) {
        const Rigid3 truth{test::random_attitude(random_), Vec3{0.05, 0.02, 1} * range_m};
        const test::Seen seen = test::see(random_, test::random_points(random_, 9, 0.8), truth, 0);
        const auto bound = pnp_bound(seen.input(), truth);
        ASSERT_TRUE(bound);
        const PnpFit& fit = refiner_.refine(seen.input(), truth);
        EXPECT_LT((fit.covariance - *bound).norm(), 1e-9 * bound->norm());
    }
}

TEST_F(PnpReference, BoundFollowsTheRules) {
    // Many points in a cube: lateral z / (f sqrt N), roll z / (f sqrt N rho), sigma of a pixel 1.
    constexpr std::size_t kPoints = 5000;
    constexpr double kHalf = 1, kRange = 100;
    const Rigid3 truth{{}, {0, 0, kRange}};
    const test::Seen seen = test::see(random_, test::random_points(random_, kPoints, kHalf), truth, 0);
    const auto bound = pnp_bound(seen.input(), truth);
    ASSERT_TRUE(bound);
    const double lateral = kRange / (seen.camera.fx * std::sqrt(kPoints)), rho = kHalf * std::sqrt(2.0 / 3);
    EXPECT_NEAR(std::sqrt((*bound)(3, 3)), lateral, 0.05 * lateral);
    EXPECT_NEAR(std::sqrt((*bound)(2, 2)), lateral / rho, 0.05 * lateral / rho);
    // rho is the rms distance from the axis; both of its coordinates tell the range.
    const double range = kRange * lateral / rho;
    EXPECT_NEAR(std::sqrt((*bound)(5, 5)), range, 0.05 * range);
}

TEST_F(PnpReference, BoundRefusesWhatHasNone) {
    const Rigid3 truth{{}, {0, 0, 10}};
    const test::Seen line = test::see(random_, {{0, 0, 0}, {1, 1, 0}, {2, 2, 0}, {3, 3, 0}}, truth, 0);
    const auto degenerate = pnp_bound(line.input(), truth);
    ASSERT_FALSE(degenerate);
    EXPECT_NE(degenerate.error().what.find("line"), std::string::npos) << degenerate.error().what;
    const test::Seen seen = test::see(random_, test::random_points(random_, 6, 1), truth, 0);
    EXPECT_FALSE(pnp_bound(seen.input(), {{}, {0, 0, -10}}));
    EXPECT_FALSE(pnp_bound({&seen.camera, {seen.body_m.data(), 2}, {seen.pixels.data(), 2}}, truth));
}

TEST(NormalEquations, AreSolvedAndInverted) {
    std::mt19937_64 random(2);
    std::normal_distribution<double> n;
    Matrix6 inverse;
    for (int trial = 0; trial < 100; ++trial) {
        Matrix6 G;
        Vector6 b;
        for (int i = 0; i < 36; ++i) G(i / 6, i % 6) = n(random);
        for (int i = 0; i < 6; ++i) b[i] = n(random);
        const Matrix6 M = G * G.transpose() + 0.01 * Matrix6::Identity();
        const DampedStep step = damped_step({M, b}, 0);
        ASSERT_TRUE(step.solved);
        EXPECT_LT((M * step.h - b).norm(), 1e-10 * b.norm());
        ASSERT_TRUE(invert_information(M, inverse));
        EXPECT_LT((M * inverse - Matrix6::Identity()).norm(), 1e-9);
        EXPECT_FALSE(damped_step({Matrix6(M - 1000 * Matrix6::Identity()), b}, 0).solved);
    }
    // The smallest pivot over its diagonal entry is twice the deviation from 1.
    Matrix6 poor = Matrix6::Identity();
    poor(1, 0) = poor(0, 1) = 1 - 1e-9;
    EXPECT_TRUE(invert_information(poor, inverse));
    poor(1, 0) = poor(0, 1) = 1 - 1e-13;
    EXPECT_FALSE(invert_information(poor, inverse));
    EXPECT_FALSE(invert_information(Matrix6::Constant(std::nan("")), inverse));
}

}  // namespace
}  // namespace narpa
