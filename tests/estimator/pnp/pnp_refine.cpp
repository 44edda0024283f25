// The refinement: where it ends, from where it gets there, its reported error, and rejected input.
#include <gtest/gtest.h>

#include <limits>

#include "base/constants.h"
#include "estimator/pnp/pnp_refine.h"
#include "tests/estimator/pnp/pnp_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

class Refine : public testing::Test {
protected:
    std::mt19937_64 random_{5};
    PnpRefiner refiner_{128};

    Rigid3 some_pose(double range_m) { return {test::random_attitude(random_), Vec3{0.02, -0.03, 1} * range_m}; }
};

// Classical Rodrigues parameters have no value at half a turn; as increments they never come near it.
TEST_F(Refine, EveryAttitudeIsReachedWithinTenSteps) {
    for (const double angle_deg : {0., 30., 60., 90., 120., 150., 170., 178., 179., 179.9, 180.}) {
        int steps_max = 0;
        for (int trial = 0; trial < 500; ++trial) {
            const Rigid3 truth{exp_rotation(test::random_direction(random_) * (angle_deg * kRadPerDeg)),
                               {0.3, -0.2, 15}};
            const test::Seen seen = test::see(random_, test::random_points(random_, 12, 2.5), truth, 0.1);
            const PnpFit& fit =
                refiner_.refine(seen.input(), test::pose_off_by(random_, truth, 3 * kRadPerDeg, 0.02));
            ASSERT_TRUE(fit.ok()) << to_text(fit.status);
            steps_max = std::max(steps_max, fit.summary.iterations);
            // Chi-square of six degrees of freedom exceeds 45 once in 2e7 draws.
            EXPECT_LT(normalised_error_squared(error_between(fit.T_camera_body, truth), fit.covariance), 45);
        }
        EXPECT_LE(steps_max, 10) << angle_deg;
    }
}

TEST_F(Refine, SignOfTheQuaternionAndItsLengthDoNotMatter) {
    const Rigid3 truth = some_pose(20);
    const test::Seen seen = test::see(random_, test::random_points(random_, 9, 2), truth, 0.3);
    const Rigid3 start = test::pose_off_by(random_, truth, 0.1, 0.03);
    const Rigid3 a = refiner_.refine(seen.input(), start).T_camera_body;
    const Rigid3 b = refiner_.refine(seen.input(), {-start.q, start.t}).T_camera_body;
    const Rigid3 c =
        refiner_.refine(seen.input(), {{start.q.w * 3, start.q.x * 3, start.q.y * 3, start.q.z * 3}, start.t})
            .T_camera_body;
    EXPECT_LT(error_between(a, b).norm(), 1e-12);
    EXPECT_LT(error_between(a, c).norm(), 1e-9);
}

TEST_F(Refine, ExactPixelsGiveTheExactPose) {
    for (int trial = 0; trial < 100; ++trial) {
        const Rigid3 truth = some_pose(10);
        const test::Seen seen = test::see(random_, test::random_points(random_, 6, 2), truth, 0);
        const PnpFit& fit = refiner_.refine(seen.input(), test::pose_off_by(random_, truth, 0.1, 0.03));
        ASSERT_TRUE(fit.ok());
        EXPECT_LT(error_between(fit.T_camera_body, truth).norm(), 1e-8);
    }
}

// The covariance is about errors and chi2 about residuals: both have the mean of their distribution.
TEST_F(Refine, CovarianceAndChiSquareAreConsistent) {
    constexpr int kTrials = 2000;
    double nees = 0, chi2 = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const Rigid3 truth = some_pose(30);
        const test::Seen seen = test::see(random_, test::random_points(random_, 12, 2), truth, 0.5);
        const PnpFit& fit = refiner_.refine(seen.input(), truth);
        ASSERT_TRUE(fit.ok());
        ASSERT_EQ(fit.degrees_of_freedom, 18);
        nees += normalised_error_squared(error_between(fit.T_camera_body, truth), fit.covariance);
        chi2 += fit.chi2;
    }
    EXPECT_NEAR(nees / kTrials, 6, 4 * std::sqrt(12.0 / kTrials));
    EXPECT_NEAR(chi2 / kTrials, 18, 4 * std::sqrt(36.0 / kTrials));
}

TEST_F(Refine, PointsOfUnequalNoiseWeighByTheirCovariance) {
    constexpr int kTrials = 500;
    std::normal_distribution<double> n;
    double nees = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const Rigid3 truth = some_pose(12);
        test::Seen seen = test::see(random_, test::random_points(random_, 20, 2), truth, 0);
        std::vector<PixelCovariance> covariances;
        for (std::size_t i = 0; i < seen.pixels.size(); ++i) {
            const double a = i % 4 == 0 ? 3.0 : 0.2, b = i % 3 == 0 ? -1.0 : 0.1, c = 0.3;
            const double x = n(random_), y = n(random_);
            seen.pixels[i].u += a * x + b * y, seen.pixels[i].v += c * y;
            covariances.push_back({a * a + b * b, b * c, c * c});
        }
        PnpInput input = seen.input();
        input.covariance_px2 = covariances;
        const PnpFit& fit = refiner_.refine(input, truth);
        ASSERT_TRUE(fit.ok());
        nees += normalised_error_squared(error_between(fit.T_camera_body, truth), fit.covariance);
    }
    EXPECT_NEAR(nees / kTrials, 6, 4 * std::sqrt(12.0 / kTrials));
}

TEST_F(Refine, CovarianceIsOfTheBodysOriginWhereverThePointsAre) {
    const Rigid3 truth = some_pose(30);
    const test::Seen seen = test::see(random_, test::random_points(random_, 12, 2), truth, 0.5);
    const PnpFit near = refiner_.refine(seen.input(), truth);
    const Vec3 offset{40, -300, 25};
    test::Seen moved = seen;
    for (Vec3& p : moved.body_m) p += offset;
    const Rigid3 T_body_moved{{}, -offset};
    const PnpFit far = refiner_.refine(moved.input(), truth * T_body_moved);
    ASSERT_TRUE(near.ok() && far.ok());
    EXPECT_LT(error_between(far.T_camera_body, near.T_camera_body * T_body_moved).norm(), 1e-6);
    const Matrix6 expected = covariance_of_product(near.T_camera_body, near.covariance, T_body_moved);
    EXPECT_LT((far.covariance - expected).norm(), 1e-5 * expected.norm());
}

TEST_F(Refine, RobustLossRejectsOutliers) {
    for (int trial = 0; trial < 20; ++trial) {
        const Rigid3 truth = some_pose(30);
        test::Seen seen = test::see(random_, test::random_points(random_, 40, 2), truth, 0.3);
        for (std::size_t i = 0; i < 4; ++i) seen.pixels[i].u += 40, seen.pixels[i].v -= 25;
        RefineOptions options;
        options.loss = {Loss::cauchy, 3};
        const PnpFit robust =
            refiner_.refine(seen.input(), test::pose_off_by(random_, truth, 0.002, 0.0005), options);
        const PnpFit plain = refiner_.refine(seen.input(), truth);
        ASSERT_TRUE(robust.ok()) << to_text(robust.status);
        const double error = norm(rotation_vector(robust.T_camera_body.q * conjugate(truth.q)));
        const double sigma = std::sqrt(robust.covariance.topLeftCorner<3, 3>().trace());
        EXPECT_LT(error, 5 * sigma);
        EXPECT_GT(plain.chi2, 25 * plain.degrees_of_freedom);
    }
}

TEST_F(Refine, CostsNeverRiseAndAreAllReported) {
    const Rigid3 truth = some_pose(10);
    const test::Seen seen = test::see(random_, test::random_points(random_, 12, 2), truth, 0.5);
    const PnpFit& fit = refiner_.refine(seen.input(), test::pose_off_by(random_, truth, 0.5, 0.1));
    ASSERT_TRUE(fit.ok());
    const auto costs = fit.summary.costs();
    ASSERT_EQ(costs.size(), static_cast<std::size_t>(fit.summary.iterations) + 1);
    EXPECT_GT(costs.front(), 1e4);
    for (std::size_t i = 1; i < costs.size(); ++i) EXPECT_LE(costs[i], costs[i - 1]);
    EXPECT_EQ(costs.back(), fit.chi2);
}

TEST_F(Refine, TouchesNoHeap) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer brings its own heap";
    const Rigid3 truth = some_pose(10);
    const test::Seen seen = test::see(random_, test::random_points(random_, 100, 2), truth, 0.5);
    const Rigid3 start = test::pose_off_by(random_, truth, 0.1, 0.03);
    RefineOptions robust;
    robust.loss = {Loss::cauchy, 2};
    const test::AllocationCounter counter;
    for (int i = 0; i < 10; ++i) {
        (void)refiner_.refine(seen.input(), start);
        (void)refiner_.refine(seen.input(), start, robust);
    }
    EXPECT_EQ(counter.on_this_thread(), 0u);
}

TEST_F(Refine, PointsOnALineAreDegenerate) {
    const Rigid3 truth = some_pose(10);
    const Vec3 along = test::random_direction(random_);
    std::vector<Vec3> line;
    for (int i = 0; i < 10; ++i) line.push_back(Vec3{1, 2, 3} + along * (0.4 * i));
    EXPECT_EQ(refiner_.refine(test::see(random_, line, truth, 0).input(), truth).status, PnpStatus::degenerate);
    EXPECT_EQ(refiner_.refine(test::see(random_, line, truth, 0.5).input(), truth).status, PnpStatus::degenerate);
    const std::vector<Vec3> same(6, Vec3{0.1, 0.2, 0.3});
    EXPECT_EQ(refiner_.refine(test::see(random_, same, truth, 0.5).input(), truth).status, PnpStatus::degenerate);
}

TEST_F(Refine, DuplicatesCountTwice) {
    const Rigid3 truth = some_pose(10);
    test::Seen seen = test::see(random_, test::random_points(random_, 8, 2), truth, 0.5);
    const PnpFit once = refiner_.refine(seen.input(), truth);
    for (std::size_t i = 0; i < 8; ++i)
        seen.body_m.push_back(Vec3(seen.body_m[i])), seen.pixels.push_back(Pixel(seen.pixels[i]));
    const PnpFit twice = refiner_.refine(seen.input(), truth);
    ASSERT_TRUE(once.ok() && twice.ok());
    EXPECT_LT(error_between(once.T_camera_body, twice.T_camera_body).norm(), 1e-6);
    EXPECT_LT((2 * twice.covariance - once.covariance).norm(), 1e-4 * once.covariance.norm());
}

TEST_F(Refine, StaysInFrontOfTheCamera) {
    for (int trial = 0; trial < 200; ++trial) {
        const Rigid3 truth{test::random_attitude(random_), {0, 0, 2.5}};
        const test::Seen seen = test::see(random_, test::random_points(random_, 12, 1.2), truth, 0.5);
        Rigid3 start = test::pose_off_by(random_, truth, 0.3, 0.1);
        start.t.z += 0.3;
        const PnpFit& fit = refiner_.refine(seen.input(), start);
        if (fit.status == PnpStatus::behind_camera) continue;
        for (const Vec3& p : seen.body_m) EXPECT_GT((fit.T_camera_body * p).z, 0);
    }
    const Rigid3 truth = some_pose(10);
    const test::Seen seen = test::see(random_, test::random_points(random_, 6, 2), truth, 0.5);
    EXPECT_EQ(refiner_.refine(seen.input(), {truth.q, -truth.t}).status, PnpStatus::behind_camera);
}

TEST_F(Refine, BadInputIsReported) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(),
                     kInf = std::numeric_limits<double>::infinity();
    const Rigid3 truth = some_pose(10);
    const test::Seen good = test::see(random_, test::random_points(random_, 6, 2), truth, 0.5);
    const auto status = [&](const auto& spoil, Rigid3 start) {
        test::Seen seen = good;
        spoil(seen);
        return refiner_.refine(seen.input(), start).status;
    };
    EXPECT_EQ(status([](auto&) {}, truth), PnpStatus::converged);
    for (const double bad : {kNaN, kInf, -kInf}) {
        EXPECT_EQ(status([&](auto& s) { s.body_m[2].y = bad; }, truth), PnpStatus::not_finite);
        EXPECT_EQ(status([&](auto& s) { s.pixels[5].v = bad; }, truth), PnpStatus::not_finite);
        EXPECT_EQ(status([](auto&) {}, {truth.q, {0, bad, 10}}), PnpStatus::not_finite);
        EXPECT_EQ(status([](auto&) {}, {{bad, 0, 0, 0}, truth.t}), PnpStatus::not_finite);
        EXPECT_EQ(status([&](auto& s) { s.camera.fx = bad; }, truth), PnpStatus::bad_camera);
        EXPECT_EQ(status([&](auto& s) { s.sigma_px = bad; }, truth), PnpStatus::bad_noise);
    }
    EXPECT_EQ(status([](auto&) {}, {{0, 0, 0, 0}, truth.t}), PnpStatus::not_finite);
    EXPECT_EQ(status([](auto& s) { s.camera.fy = 0; }, truth), PnpStatus::bad_camera);
    EXPECT_EQ(status([](auto& s) { s.sigma_px = 0; }, truth), PnpStatus::bad_noise);
    EXPECT_EQ(status([](auto& s) { s.pixels.pop_back(); }, truth), PnpStatus::sizes_differ);
    EXPECT_EQ(status([](auto& s) { s.pixels.resize(2), s.body_m.resize(2); }, truth), PnpStatus::too_few_points);
    EXPECT_EQ(status([](auto& s) { s.pixels.clear(), s.body_m.clear(); }, truth), PnpStatus::too_few_points);
    EXPECT_EQ(status([](auto& s) { s.pixels.resize(200), s.body_m.resize(200); }, truth),
              PnpStatus::too_many_points);

    PnpInput input = good.input();
    std::vector<PixelCovariance> covariances(6, {1, 1.5, 1});
    input.covariance_px2 = covariances;
    EXPECT_EQ(refiner_.refine(input, truth).status, PnpStatus::bad_noise);
    covariances.assign(5, {1, 0, 1});
    input.covariance_px2 = covariances;
    EXPECT_EQ(refiner_.refine(input, truth).status, PnpStatus::sizes_differ);
}

}  // namespace
}  // namespace narpa
