// Matches whose rows were exposed one after the other.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "estimator/features/match_suspects.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/uncertainty/untold.h"
#include "renderer/projection/pinhole.h"

namespace narpa {
namespace {

const Pinhole kCameraOfMatches{500, 500, 159.5, 119.5};
const Rigid3 kPoseOfMatches{exp_rotation({0.4, -0.3, 0.2}), {0.1, 0, 8}};

/// Sixty points on two faces of a cube, far enough from each other; rows move by `skew_px` over the image.
ModelMatches matches(double skew_px, std::mt19937_64& random) {
    ModelMatches m;
    std::uniform_real_distribution<double> u(-1, 1);
    std::normal_distribution<double> noise(0, 0.1);
    for (int i = 0; i < 60; ++i) {
        const Vec3 p = i % 2 == 0 ? Vec3{u(random), u(random), -1} : Vec3{1, u(random), u(random)};
        const auto image = kCameraOfMatches.project(kPoseOfMatches * p);
        m.body_m.push_back(p);
        m.in_view.push_back({image->x, image->y});
        const double row = (image->y - 119.5) / 240;
        m.pixels.push_back({image->x + skew_px * row + noise(random), image->y + noise(random)});
        m.noise.push_back(1e-4 * Eigen::Matrix2d::Identity());
    }
    return m;
}

TEST(MatchSuspects, OfNoiseAreQuiet) {
    std::mt19937_64 random(4);
    for (int i = 0; i < 50; ++i)
        EXPECT_LT(progressive_rows(matches(0, random), kCameraOfMatches, kPoseOfMatches, 0.1).sigmas, 4) << i;
}

/// On a plane the pose nearly explains some motions with the row; these must not count.
TEST(MatchSuspects, OfNoiseOnAPlaneAreQuiet) {
    std::mt19937_64 random(6);
    std::uniform_real_distribution<double> u(-1, 1);
    std::normal_distribution<double> noise(0, 0.1);
    for (int trial = 0; trial < 50; ++trial) {
        ModelMatches m;
        for (int i = 0; i < 60; ++i) {
            const Vec3 p{u(random), u(random), 0};
            const auto image = kCameraOfMatches.project(kPoseOfMatches * p);
            m.body_m.push_back(p);
            m.in_view.push_back({image->x, image->y});
            m.pixels.push_back({image->x + noise(random), image->y + noise(random)});
            m.noise.push_back(1e-4 * Eigen::Matrix2d::Identity());
        }
        const MatchSuspicion found = progressive_rows(m, kCameraOfMatches, kPoseOfMatches, 0.1);
        EXPECT_LT(found.sigmas, 4) << trial;
        EXPECT_LT(found.shift.tail<3>().norm(), 0.5) << trial << ": the pose's own sigma is about 0.05 m";
    }
}

TEST(MatchSuspects, ShowRowsThatAreShifted) {
    std::mt19937_64 random(5);
    for (int i = 0; i < 10; ++i) {
        const MatchSuspicion found = progressive_rows(matches(3, random), kCameraOfMatches, kPoseOfMatches, 0.1);
        EXPECT_GT(found.sigmas, 4) << i;
        EXPECT_TRUE(refuses(found.sigmas, found.shift, 1e-6 * Matrix6::Identity())) << i;
    }
}

TEST(UntoldErrors, RefuseWhatIsShownAndMatters) {
    const Matrix6 C = Matrix6::Identity();
    const Vector6 near = 0.1 * Vector6::Unit(0), off = 1.0 * Vector6::Unit(0), far = 6.0 * Vector6::Unit(0);
    EXPECT_FALSE(refuses(10, near, C)) << "it does not move the pose";
    EXPECT_FALSE(refuses(3, off, C)) << "it may be noise";
    EXPECT_TRUE(refuses(5, off, C));
    EXPECT_TRUE(refuses(3, far, C));
    EXPECT_NEAR(as_normal(6, 6), 0.2, 0.2);
    EXPECT_NEAR(as_normal(22.46, 6), 3.09, 0.05);  // 0.1 %
}

}  // namespace
}  // namespace narpa
