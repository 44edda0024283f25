// Poses to start from: near enough for the refinement, and both of those that a flat body allows.
#include "estimator/pnp/pnp_start.h"
#include "base/constants.h"

#include <gtest/gtest.h>

#include "tests/estimator/pnp/pnp_support.h"

namespace narpa {
namespace {

class PnpStart : public testing::Test {
protected:
    std::mt19937_64 random_{17};

    struct Gathered {
        PnpPoints points;
        std::vector<BodyPoint> list;
        PointExtent spread;

        explicit Gathered(const test::Seen& seen) : points(seen.body_m.size()) {
            points.assign(seen.input());
            for (std::size_t i = 0; i < points.size(); ++i)
                list.push_back({points.centred_body_m(i), points.normalised(i)});
            spread = extent_of(list);
        }
    };
    static double angle(const CentredPose& pose, const Rigid3& truth) { return angle_between(pose.q, truth.q); }
};

TEST_F(PnpStart, SpreadIsAlongTheAxes) {
    std::vector<Vec3> points = test::random_points(random_, 3000, 1);
    const Quat turned = test::random_attitude(random_);
    for (Vec3& p : points) p = turned * Vec3{0.5 * p.x, 4 * p.y, 2 * p.z};
    const Gathered g(test::see(random_, points, {{}, {0, 0, 50}}, 0));
    const double rms = 1 / std::sqrt(3.0);
    EXPECT_NEAR(g.spread.rms_m.x, 4 * rms, 0.1);
    EXPECT_NEAR(g.spread.rms_m.y, 2 * rms, 0.05);
    EXPECT_NEAR(g.spread.rms_m.z, 0.5 * rms, 0.02);
    EXPECT_NEAR(std::abs(dot(g.spread.axis[0], turned * Vec3{0, 1, 0})), 1, 1e-2);
    EXPECT_NEAR(dot(cross(g.spread.axis[0], g.spread.axis[1]), g.spread.axis[2]), 1, 1e-12);
}

TEST_F(PnpStart, SolidBodiesGiveOnePoseNearTheTruth) {
    for (const double range_m : {6., 20., 200.}) {
        for (int trial = 0; trial < 100; ++trial) {
            const Rigid3 truth{test::random_attitude(random_), Vec3{0.05, -0.08, 1} * range_m};
            const Gathered g(test::see(random_, test::random_points(random_, 8, 1), truth, 0));
            const InitialPoses starts = orthographic_poses(g.list, g.spread, false);
            ASSERT_EQ(starts.count, 1u);
            EXPECT_LT(angle(starts.pose[0], truth), 3 * kRadPerDeg) << range_m;
            EXPECT_LT(norm(g.points.uncentred(starts.pose[0]).t - truth.t), 0.03 * range_m);
        }
    }
}

TEST_F(PnpStart, FlatBodiesGiveTwoOfWhichOneIsNear) {
    constexpr int kTrials = 100;
    int near = 0, mirrored = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const Rigid3 truth{test::random_attitude(random_), {0.4, -0.3, 25}};
        std::vector<Vec3> flat = test::random_points(random_, 6, 1);
        for (Vec3& p : flat) p.z = 0;
        const Gathered g(test::see(random_, flat, truth, 0));
        const InitialPoses starts = orthographic_poses(g.list, g.spread, true);
        ASSERT_EQ(starts.count, 2u);
        const double first = angle(starts.pose[0], truth), second = angle(starts.pose[1], truth);
        near += std::min(first, second) < 3 * kRadPerDeg ? 1 : 0;
        // They are mirror images of one another, as far as perspective is small.
        mirrored +=
            angle_between(depth_reversed(starts.pose[0], g.spread).q, starts.pose[1].q) < 8 * kRadPerDeg ? 1 : 0;
    }
    // The rest is seen almost on edge, where the two meet.
    EXPECT_GE(near, 90);
    EXPECT_GE(mirrored, 90);
}

TEST_F(PnpStart, ReversedTwiceIsAsBefore) {
    const Rigid3 truth{test::random_attitude(random_), {1, 2, 30}};
    const Gathered g(test::see(random_, test::random_points(random_, 6, 1), truth, 0));
    const CentredPose pose = g.points.centred(truth);
    const CentredPose once = depth_reversed(pose, g.spread), twice = depth_reversed(once, g.spread);
    EXPECT_LT(angle_between(twice.q, pose.q), 1e-12);
    // Across the line of sight nothing moves but by perspective.
    const Vec3 sight = normalized(pose.centroid_m);
    for (const BodyPoint& p : g.list) {
        const double along = dot(g.spread.axis[2], p.body_m);
        const Vec3 in_plane = p.body_m - along * g.spread.axis[2];
        const Vec3 before = pose.q * in_plane, after = once.q * in_plane;
        EXPECT_LT(norm((before - dot(sight, before) * sight) - (after - dot(sight, after) * sight)), 1e-12);
        EXPECT_NEAR(dot(sight, before), -dot(sight, after), 1e-12);
    }
}

TEST_F(PnpStart, TriplesNeedNotBeCentred) {
    int near = 0;
    constexpr int kTrials = 100;
    for (int trial = 0; trial < kTrials; ++trial) {
        const Rigid3 truth{test::random_attitude(random_), {0.4, -0.3, 25}};
        const test::Seen seen = test::see(random_, test::random_points(random_, 5, 1), truth, 0);
        const Gathered g(seen);
        const InitialPoses starts = three_point_poses({g.list[0], g.list[1], g.list[2]});
        double best = M_PI, off = 1e9;
        for (std::size_t i = 0; i < starts.count; ++i) {
            best = std::min(best, angle(starts.pose[i], truth));
            off = std::min(off, norm(g.points.uncentred(starts.pose[i]).t - truth.t));
        }
        near += best < 5 * kRadPerDeg && off < 0.5 ? 1 : 0;
    }
    EXPECT_GE(near, 90);  // the rest: triples nearly on a line, or on edge
}

TEST_F(PnpStart, SqpnpIsExactOnExactPixels) {
    for (int trial = 0; trial < 50; ++trial) {
        const Rigid3 truth{test::random_attitude(random_), {0.1, -0.1, 6}};
        const Gathered g(test::see(random_, test::random_points(random_, 8, 1), truth, 0));
        const auto start = sqpnp_pose(g.list);
        ASSERT_TRUE(start);
        EXPECT_LT(error_between(g.points.uncentred(*start), truth).norm(), 1e-4);
    }
    EXPECT_FALSE(sqpnp_pose({})) << "of no points";
}

TEST_F(PnpStart, CollinearOrCoincidingPointsGiveNoPose) {
    const Rigid3 truth{test::random_attitude(random_), {0, 0, 10}};
    std::vector<Vec3> line;
    for (int i = 0; i < 6; ++i) line.push_back(Vec3{1, 2, 3} * (0.1 * i));
    for (const std::vector<Vec3>& points : {line, std::vector<Vec3>(6, Vec3{1, 1, 1})}) {
        const Gathered g(test::see(random_, points, truth, 0));
        EXPECT_EQ(orthographic_poses(g.list, g.spread, true).count, 0u);
        EXPECT_EQ(orthographic_poses(g.list, g.spread, false).count, 0u);
    }
}

}  // namespace
}  // namespace narpa
