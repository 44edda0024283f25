// ICP on a cube with errors that each point states itself, and errors that all points have in common.
#include <gtest/gtest.h>

#include <random>

#include "estimator/cloud/cloud_icp.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

const Rigid3 kCubeTruth{normalized(Quat{0.8, 0.3, -0.4, 0.2}), {1.0, 12.0, -0.5}};
const Rigid3 kStart{kCubeTruth.q * exp_rotation({4e-4, -3e-4, 5e-4}), kCubeTruth.t + Vec3{0.001, -0.002, 0.0015}};

Scene cube_of_two_metres() {
    Scene scene;
    scene.materials.push_back(test::lambert(0.5f));
    test::add_mesh(scene, test::box(2, 2, 2));
    return scene;
}

/// 600 returns from the first `faces` of +x, +y, +z, -x, -y, -z, by beams up to 50 degrees off their normals.
std::vector<RangePoint> cube_returns(int faces, double noise_m, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::uniform_real_distribution<double> place(-0.99, 0.99);
    std::vector<RangePoint> points;
    for (int i = 0; i < 600; ++i) {
        const int face = i % faces, axis = face % 3;
        Vec3 p, n;
        n[axis] = face < 3 ? 1 : -1;
        p[axis] = n[axis], p[(axis + 1) % 3] = place(random), p[(axis + 2) % 3] = place(random);
        const Vec3 origin = p + 4.0 * normalized(n + cross(n, test::random_direction(random)));
        points.push_back({kCubeTruth * origin, kCubeTruth.q * normalized(p - origin), 4 + noise_m * noise(random)});
    }
    return points;
}

/// Ranges of a cube whose errors are twenty times as large for one half of them, as their standard deviations say.
TEST(IcpPointErrors, PointsAreWeightedByTheirOwnStandardDeviations) {
    const Scene scene = cube_of_two_metres();
    const auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    IcpSettings settings;
    settings.noise = {0.01, 0};
    double with = 0, without = 0, nees = 0;
    constexpr int kSweeps = 40;
    for (std::uint64_t seed = 0; seed < kSweeps; ++seed) {
        std::vector<RangePoint> points = cube_returns(6, 0, seed);
        std::mt19937_64 random(1000 + seed);
        std::normal_distribution<double> noise;
        for (std::size_t i = 0; i < points.size(); ++i) {
            points[i].sigma_m = i % 2 == 0 ? 0.002 : 0.04;
            points[i].range_m += points[i].sigma_m * noise(random);
        }
        CloudIcp icp(*tracer, 0, settings);
        const auto e = icp.align(points, {}, kStart);
        for (RangePoint& p : points) p.sigma_m = 0;
        const auto same = icp.align(points, {}, kStart);
        ASSERT_TRUE(e && same);
        EXPECT_EQ(e->answer.kind, AnswerKind::good) << e->answer.why;
        const Vector6 error = error_between(e->T_lidar_target, kCubeTruth);
        nees += normalised_error_squared(error, e->covariance) / kSweeps;
        with += error.tail<3>().squaredNorm();
        without += error_between(same->T_lidar_target, kCubeTruth).tail<3>().squaredNorm();
    }
    EXPECT_LT(std::sqrt(with), 0.6 * std::sqrt(without));
    EXPECT_GT(nees, 4.9) << "95 % of such means are within 1.07 of 6";
    EXPECT_LT(nees, 7.1);
}

/// An error of 5 mm that all ranges have in common does not average out, and the filter is told so.
TEST(IcpPointErrors, CommonErrorsOfTheRangesAreInTheCovariance) {
    const Scene scene = cube_of_two_metres();
    const auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    IcpSettings settings;
    settings.noise = {0.002, 0};
    std::vector<RangePoint> points = cube_returns(3, 0.002, 5);
    CloudIcp icp(*tracer, 0, settings);
    const auto alone = icp.align(points, {}, kStart);
    for (RangePoint& p : points) p.common_m[1] = 0.005;
    const auto common = icp.align(points, {}, kStart);
    for (RangePoint& p : points) p.common_m[1] = 0, p.range_m += 0.005;
    const auto longer = icp.align(points, {}, kStart);
    ASSERT_TRUE(alone && common && longer);
    EXPECT_EQ(alone->covariance_of_model.norm(), 0);
    const Vector6 shift = error_between(alone->T_lidar_target, longer->T_lidar_target);
    EXPECT_GT(shift.tail<3>().norm(), 0.003);
    EXPECT_NEAR((common->covariance_of_model - shift * shift.transpose()).norm(), 0, 0.1 * shift.squaredNorm());
    EXPECT_NEAR((common->covariance - alone->covariance - common->covariance_of_model).norm(), 0,
                1e-6 * shift.squaredNorm());
    points[3].sigma_m = -1;
    EXPECT_FALSE(icp.align(points, {}, kCubeTruth));
}

}  // namespace
}  // namespace narpa
