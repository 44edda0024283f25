// Poses without a guess: how often, how exactly, and whether doubtful poses are flagged.
#include <gtest/gtest.h>

#include <limits>

#include "base/constants.h"
#include "estimator/pnp/pnp.h"
#include "estimator/pnp/pnp_refine.h"
#include "tests/estimator/pnp/pnp_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

class SolvePnp : public testing::Test {
protected:
    std::mt19937_64 random_{9};
    PnpSolver solver_{256};

    Rigid3 some_pose(double range_m) { return {test::random_attitude(random_), Vec3{0.02, -0.03, 1} * range_m}; }

    /// The body's z axis so far from the line of sight.
    Rigid3 tilted(double tilt_deg, double range_m) {
        std::uniform_real_distribution<double> turn(-M_PI, M_PI);
        const double a = turn(random_);
        return {exp_rotation(Vec3{std::cos(a), std::sin(a), 0} * (tilt_deg * kRadPerDeg)) *
                    exp_rotation({0, 0, turn(random_)}),
                {0, 0, range_m}};
    }
    std::vector<Vec3> square(std::size_t n, double half_m) {
        std::vector<Vec3> points = test::random_points(random_, n, half_m);
        for (Vec3& p : points) p.z = 0;
        return points;
    }
};

struct Bounds {
    double rotation_rad, position_m;
};
Bounds bounds(const test::Seen& seen) {
    const auto C = pnp_bound(seen.input(), seen.T_camera_body);
    EXPECT_TRUE(C);
    return {std::sqrt(C->topLeftCorner<3, 3>().trace()), std::sqrt(C->bottomRightCorner<3, 3>().trace())};
}

// RMS error over the bound, both of 300 draws: its own deviation is below 0.05.
TEST_F(SolvePnp, AttainsTheBound) {
    constexpr int kTrials = 300;
    for (const auto& [n, range_m, sigma_px] :
         {std::tuple{10u, 10., 0.5}, {10u, 100., 0.1}, {30u, 30., 1.}, {100u, 200., 0.5}, {100u, 4., 0.1}}) {
        double rotation = 0, position = 0;
        for (int trial = 0; trial < kTrials; ++trial) {
            const test::Seen seen = test::see(random_, test::random_points(random_, n, std::min(2., 0.2 * range_m)),
                                              some_pose(range_m), sigma_px);
            const PnpSolution& s = solver_.solve(seen.input());
            ASSERT_TRUE(s.ok()) << to_text(s.status);
            const Bounds b = bounds(seen);
            const Vector6 e = error_between(s.fit.T_camera_body, seen.T_camera_body);
            rotation += e.head<3>().squaredNorm() / (b.rotation_rad * b.rotation_rad) / kTrials;
            position += e.tail<3>().squaredNorm() / (b.position_m * b.position_m) / kTrials;
        }
        constexpr double kOfTheBound = 1.1, kChance = 0.1;
        EXPECT_LT(std::sqrt(rotation), kOfTheBound + kChance) << n << " at " << range_m;
        EXPECT_LT(std::sqrt(position), kOfTheBound + kChance) << n << " at " << range_m;
        EXPECT_GT(std::sqrt(rotation), 0.85);
    }
}

TEST_F(SolvePnp, ExactPixelsGiveTheExactPose) {
    for (const std::size_t n : {4u, 5u, 6u, 20u}) {
        int wrong = 0;
        for (int trial = 0; trial < 200; ++trial) {
            const test::Seen seen = test::see(random_, test::random_points(random_, n, 1), some_pose(8), 0);
            PnpInput input = seen.input();
            input.sigma_px = 1e-3;
            const PnpSolution& s = solver_.solve(input);
            ASSERT_TRUE(s.ok()) << to_text(s.status);
            wrong += error_between(s.fit.T_camera_body, seen.T_camera_body).norm() < 1e-6 ? 0 : 1;
        }
        EXPECT_EQ(wrong, 0) << n;
    }
}

// The rounding of the residuals is then a large part of their noise, or all of it.
TEST_F(SolvePnp, SettlesWhereRoundingIsTheNoise) {
    for (const double sigma_px : {1e-6, 1e-9, 1e-12})
        for (const std::size_t n : {4u, 6u, 10u, 30u, 100u})
            for (int trial = 0; trial < 200; ++trial) {
                const test::Seen seen =
                    test::see(random_, test::random_points(random_, n, 1), some_pose(8), sigma_px);
                const PnpSolution& s = solver_.solve(seen.input());
                ASSERT_TRUE(s.ok()) << to_text(s.status) << ": " << n << " points, " << sigma_px << " px";
                const Vector6 e = error_between(s.fit.T_camera_body, seen.T_camera_body);
                // Four points have several poses that fit.
                if (n == 4) continue;
                ASSERT_LT(e.norm(), std::max(1e-11, 1e4 * sigma_px)) << n << " points, " << sigma_px << " px";
            }
}

TEST_F(SolvePnp, HalfATurnIsLikeAnyOther) {
    for (int trial = 0; trial < 200; ++trial) {
        const Rigid3 truth{exp_rotation(test::random_direction(random_) * M_PI), {0.5, 0, 30}};
        const test::Seen seen = test::see(random_, test::random_points(random_, 8, 2), truth, 0.3);
        const PnpSolution& s = solver_.solve(seen.input());
        ASSERT_TRUE(s.ok());
        EXPECT_LT(normalised_error_squared(error_between(s.fit.T_camera_body, truth), s.fit.covariance), 45);
    }
}

// A plane far away shows the same picture with the opposite tilt.
TEST_F(SolvePnp, BothMinimaOfAPlaneAreReported) {
    int wrong = 0, wrong_and_told = 0, second_is_true = 0, unsettled = 0;
    for (const double range_m : {10., 30., 100.}) {
        for (const double tilt_deg : {5., 15., 40.}) {
            for (int trial = 0; trial < 4000; ++trial) {
                const test::Seen seen = test::see(random_, square(8, 1), tilted(tilt_deg, range_m), 0.3);
                const PnpSolution& s = solver_.solve(seen.input());
                ASSERT_TRUE(s.ok() || s.status == PnpStatus::no_convergence) << to_text(s.status);
                unsettled += s.ok() ? 0 : 1;
                const auto is_true = [&](const PnpFit& f) {
                    return normalised_error_squared(error_between(f.T_camera_body, seen.T_camera_body),
                                                    f.covariance) < 45;
                };
                if (is_true(s.fit)) continue;
                ++wrong;
                wrong_and_told += s.ambiguous() ? 1 : 0;
                second_is_true += s.ambiguous() && is_true(s.second) ? 1 : 0;
            }
        }
    }
    // Facing the camera, the tilt shows in second order only: a valley that is not followed to its end each time.
    EXPECT_LE(unsettled, 36);  // one in a thousand
    EXPECT_GT(wrong, 4000);
    EXPECT_GE(wrong_and_told, 0.985 * wrong);  // measured 99.0 %; 0.15 % is a standard deviation of so many
    EXPECT_GE(second_is_true, 0.96 * wrong);   // 97.3 %
}

TEST_F(SolvePnp, NearPlanesAreNotAmbiguous) {
    for (int trial = 0; trial < 200; ++trial) {
        const test::Seen seen = test::see(random_, square(8, 1), tilted(40, 6), 0.3);
        const PnpSolution& s = solver_.solve(seen.input());
        ASSERT_TRUE(s.ok());
        EXPECT_FALSE(s.ambiguous());
    }
}

TEST_F(SolvePnp, StrongPerspectiveIsSolved) {
    int wrong = 0;
    for (int trial = 0; trial < 200; ++trial) {
        // Points from 0.1 m to 4 m in front of the camera.
        std::vector<Vec3> points = test::random_points(random_, 12, 1);
        for (Vec3& p : points) p = {0.05 * p.x, 0.05 * p.y, 1.95 * p.z};
        const test::Seen seen = test::see(random_, points, tilted(3, 2.05), 0.5);
        const PnpSolution& s = solver_.solve(seen.input());
        wrong += s.ok() && normalised_error_squared(error_between(s.fit.T_camera_body, seen.T_camera_body),
                                                    s.fit.covariance) < 60
                     ? 0
                     : 1;
    }
    EXPECT_EQ(wrong, 0);
}

TEST_F(SolvePnp, OutliersAreFoundAndLeftOut) {
    for (const auto& [n, part] : {std::pair{10u, 0.2}, {40u, 0.2}, {40u, 0.5}, {100u, 0.5}}) {
        int wrong = 0;
        double error2 = 0;
        constexpr int kTrials = 100;
        for (int trial = 0; trial < kTrials; ++trial) {
            test::Seen seen = test::see(random_, test::random_points(random_, n, 2), some_pose(20), 0.5);
            std::uniform_real_distribution<double> anywhere(0, 500);
            const auto outliers = static_cast<std::size_t>(part * n);
            for (std::size_t i = 0; i < outliers; ++i) seen.pixels[i] = {anywhere(random_), anywhere(random_)};
            const PnpSolution& s = solver_.solve(seen.input(), true);
            ASSERT_TRUE(s.ok()) << to_text(s.status);
            const double e2 =
                normalised_error_squared(error_between(s.fit.T_camera_body, seen.T_camera_body), s.fit.covariance);
            wrong += e2 < 45 ? 0 : 1;
            error2 += e2 / kTrials;
            ASSERT_EQ(s.inlier.size(), n);
            EXPECT_EQ(s.inliers, static_cast<std::size_t>(std::count(s.inlier.begin(), s.inlier.end(), 1)));
        }
        EXPECT_EQ(wrong, 0) << n << " " << part;
        EXPECT_NEAR(error2, 6, 4 * std::sqrt(12.0 / kTrials) + 0.5) << "an outlier next to its place may pass";
    }
}

TEST_F(SolvePnp, SameSeedSameAnswer) {
    test::Seen seen = test::see(random_, test::random_points(random_, 40, 2), some_pose(20), 0.5);
    for (std::size_t i = 0; i < 15; ++i) seen.pixels[i].u += 100;
    const Rigid3 first = solver_.solve(seen.input(), true).fit.T_camera_body;
    PnpSolver another(64);
    EXPECT_EQ(another.solve(seen.input(), true).fit.T_camera_body, first);
}

TEST_F(SolvePnp, NothingButOutliersIsNoConsensus) {
    test::Seen seen = test::see(random_, test::random_points(random_, 40, 2), some_pose(20), 0.5);
    std::uniform_real_distribution<double> anywhere(0, 500);
    for (Pixel& p : seen.pixels) p = {anywhere(random_), anywhere(random_)};
    EXPECT_EQ(solver_.solve(seen.input(), true).status, PnpStatus::no_consensus);
}

// Seen from the cylinder over three points, the camera may slide along it unnoticed.
TEST_F(SolvePnp, DangerCylinderIsFlagged) {
    PnpRefiner refiner(8);
    std::uniform_real_distribution<double> turn(-M_PI, M_PI);
    const auto seen_from = [&](double radius) {
        std::vector<Vec3> triangle;
        for (const double a : {0.1, 2.3, 4.2}) triangle.push_back({std::cos(a), std::sin(a), 0});
        // The camera over the rim of the unit circle, looking at its middle.
        const double a = turn(random_);
        const Vec3 eye{radius * std::cos(a), radius * std::sin(a), 10};
        const Vec3 z = normalized(-eye), x = normalized(cross(Vec3{0, 1, 0}, z)), y = cross(z, x);
        const Rigid3 T_body_camera{quat_from_columns(x, y, z), eye};
        return test::see(random_, triangle, inverse(T_body_camera), 0);
    };
    for (int trial = 0; trial < 50; ++trial) {
        test::Seen on = seen_from(1), off = seen_from(2);
        on.sigma_px = off.sigma_px = 0.3;
        const PnpFit& danger = refiner.refine(on.input(), on.T_camera_body);
        EXPECT_TRUE(danger.status == PnpStatus::degenerate || danger.relative_position_sigma() > kImpreciseSigma)
            << danger.relative_position_sigma();
        const PnpFit& safe = refiner.refine(off.input(), off.T_camera_body);
        ASSERT_TRUE(safe.ok());
        EXPECT_LT(safe.relative_position_sigma(), kImpreciseSigma);
    }
    // Four points far away: the range is poorly known, and said to be.
    const test::Seen far = test::see(random_, test::random_points(random_, 4, 0.3), some_pose(200), 0.5);
    EXPECT_TRUE(solver_.solve(far.input()).imprecise);
    const test::Seen near = test::see(random_, test::random_points(random_, 30, 2), some_pose(20), 0.5);
    EXPECT_FALSE(solver_.solve(near.input()).imprecise);
}

TEST_F(SolvePnp, AllocatesNothingUnlessOpenCvIsUsed) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer brings its own heap";
    const test::Seen seen = test::see(random_, test::random_points(random_, 30, 2), some_pose(20), 0.5);
    test::Seen spoilt = seen;
    for (std::size_t i = 0; i < 6; ++i) spoilt.pixels[i].u += 100;
    const test::AllocationCounter counter;
    EXPECT_TRUE(solver_.solve(seen.input()).ok());
    EXPECT_TRUE(solver_.solve(spoilt.input(), true).ok());
    EXPECT_EQ(counter.on_this_thread(), 0u);
}

TEST_F(SolvePnp, RefusesDegenerateOrInvalidInput) {
    const Rigid3 truth = some_pose(10);
    const auto status = [&](const std::vector<Vec3>& points, const auto& spoil, bool outliers) {
        test::Seen seen = test::see(random_, points, truth, 0.3);
        spoil(seen);
        return solver_.solve(seen.input(), outliers).status;
    };
    const auto as_seen = [](test::Seen&) {};
    std::vector<Vec3> line;
    for (int i = 0; i < 8; ++i) line.push_back(Vec3{0.1, 0.2, 0.3} * i);
    const std::vector<Vec3> good = test::random_points(random_, 8, 2);
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(),
                     kInf = std::numeric_limits<double>::infinity();
    for (const bool outliers : {false, true}) {
        EXPECT_EQ(status(good, as_seen, outliers), PnpStatus::converged);
        EXPECT_EQ(status(line, as_seen, outliers), PnpStatus::degenerate) << outliers;
        EXPECT_EQ(status(std::vector<Vec3>(8, Vec3{1, 2, 3}), as_seen, outliers), PnpStatus::degenerate)
            << outliers;
        EXPECT_EQ(status(test::random_points(random_, 3, 2), as_seen, outliers), PnpStatus::too_few_points);
        EXPECT_EQ(status(test::random_points(random_, 300, 2), as_seen, outliers), PnpStatus::too_many_points);
        for (const double bad : {kNaN, kInf}) {
            EXPECT_EQ(status(
                          good, [&](auto& s) { s.body_m[1].x = bad; }, outliers),
                      PnpStatus::not_finite);
            EXPECT_EQ(status(
                          good, [&](auto& s) { s.pixels[7].u = bad; }, outliers),
                      PnpStatus::not_finite);
        }
        EXPECT_EQ(status(
                      good, [](auto& s) { s.pixels.pop_back(); }, outliers),
                  PnpStatus::sizes_differ);
        EXPECT_EQ(status(
                      good, [](auto& s) { s.camera = {}; }, outliers),
                  PnpStatus::bad_camera);
    }
    // Numbers that are finite, and absurd, get an answer or a refusal, not a NaN.
    for (const double huge : {1e-300, 1e-12, 1e12, 1e200}) {
        std::vector<Vec3> scaled = good;
        for (Vec3& p : scaled) p = p * huge;
        test::Seen seen = test::see(random_, good, truth, 0.3);
        seen.body_m = scaled;
        const PnpSolution& s = solver_.solve(seen.input());
        if (s.ok()) {
            EXPECT_TRUE(std::isfinite(norm(s.fit.T_camera_body.t)) && s.fit.covariance.allFinite()) << huge;
        }
    }
}

TEST_F(SolvePnp, SamePointsTwiceAreSolved) {
    test::Seen seen = test::see(random_, test::random_points(random_, 5, 2), some_pose(10), 0.3);
    for (std::size_t i = 0; i < 5; ++i)
        seen.body_m.push_back(Vec3(seen.body_m[i])), seen.pixels.push_back(Pixel(seen.pixels[i]));
    const PnpSolution& s = solver_.solve(seen.input());
    ASSERT_TRUE(s.ok());
    EXPECT_LT(angle_between(s.fit.T_camera_body.q, seen.T_camera_body.q), 1 * kRadPerDeg);
}

// Twice the size at twice the range is the same picture: a wrong scale cannot be seen, only carried along.
TEST_F(SolvePnp, WrongScaleGoesIntoTheRange) {
    test::Seen seen = test::see(random_, test::random_points(random_, 12, 2), some_pose(15), 0.3);
    const Rigid3 once = solver_.solve(seen.input()).fit.T_camera_body;
    for (Vec3& p : seen.body_m) p = p * 2.0;
    const PnpSolution& s = solver_.solve(seen.input());
    ASSERT_TRUE(s.ok());
    EXPECT_LT(angle_between(s.fit.T_camera_body.q, once.q), 1e-6);
    EXPECT_LT(norm(s.fit.T_camera_body.t - 2.0 * once.t), 1e-4);
}

}  // namespace
}  // namespace narpa
