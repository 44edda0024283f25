// Poses from stereo pairs of a painted box, whose pictures are computed here ray by ray, against the truth.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <random>

#include "base/constants.h"
#include "estimator/stereo/depth_map.h"
#include "estimator/stereo/stereo_alignment.h"
#include "estimator/uncertainty/observed_error.h"
#include "tests/support/campaign.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

constexpr int kPairSize = 256;
constexpr double kPairFocal_px = 640, kBaseline_m = 0.5, kBlack_dn = 64;  // of the detector

/// DN above black at a place of the surface, body axes.
using BodyPaint = std::function<double(const Vec3&)>;

/// Waves of 3 to 30 cm in all directions.
BodyPaint painted(std::uint64_t seed) {
    struct Wave {
        Vec3 k;
        double phase;
    };
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<Wave> waves;
    for (int i = 0; i < 40; ++i)
        waves.push_back(
            {2 * kPi / (0.08 + 0.3 * uniform(random)) * test::random_direction(random), 2 * kPi * uniform(random)});
    return [waves](const Vec3& p) {
        double dn = 1200;
        for (const Wave& w : waves) dn += 60 * std::sin(dot(w.k, p) + w.phase);
        return dn;
    };
}

class StereoAlignmentTest : public testing::Test {
protected:
    StereoAlignmentTest() {
        scene_.materials.push_back(test::lambert(0.7F));
        test::add_mesh(scene_, test::box(1.7, 1.3, 1.1));
        tracer_.emplace(*Tracer::create(scene_));
        Camera c = test::camera(kPairSize, kPairSize, kPairFocal_px);
        c.format = PixelFormat::y16;
        c.detector = Detector{
            .full_well_e = 13500, .read_noise_e = 13, .shot_noise = true, .black_level_dn = 64, .bits = 12};
        pair_ = {c, c, {{}, {-kBaseline_m, 0, 0}}};
    }

    /// Mean of four rays a pixel, with the sensor's noise.
    MeasuredImage picture(const Rigid3& T_camera_body, const BodyPaint& paint, std::uint64_t seed) const {
        const Camera& c = pair_.left;
        const SensorModel sensor = sensor_model(c);
        const BodyPoses at(1);
        const Rigid3 T_body_camera = inverse(T_camera_body);
        std::mt19937_64 random(seed);
        std::normal_distribution<double> normal;
        MeasuredImage image{c.width, c.height, {}};
        for (int v = 0; v < c.height; ++v)
            for (int u = 0; u < c.width; ++u) {
                double dn = kBlack_dn;
                for (const auto& [x, y] : {std::array{-0.25, -0.25}, {0.25, -0.25}, {-0.25, 0.25}, {0.25, 0.25}}) {
                    const Vec3 ray = T_body_camera.q * c.model->direction({u + x, v + y});
                    const Hit hit = tracer_->intersect(at, {T_body_camera.t, ray}, kInfinity);
                    if (hit.body >= 0) dn += 0.25 * paint(T_body_camera.t + hit.range_m * ray);
                }
                dn += normal(random) * std::sqrt(sensor.variance_dn2(dn));
                image.dn.push_back(static_cast<float>(std::round(std::max(0.0, dn))));
            }
        return image;
    }
    struct Pictures {
        MeasuredImage left, right;
    };
    Pictures pictures(const Rigid3& truth, const BodyPaint& paint, std::uint64_t seed) const {
        return {picture(truth, paint, 2 * seed), picture(pair_.T_right_left * truth, paint, 2 * seed + 1)};
    }
    static Rigid3 truth(std::mt19937_64& random) {
        return {test::random_attitude(random), {0.2, -0.1, std::uniform_real_distribution<double>(5, 9)(random)}};
    }

    Scene scene_;
    std::optional<Tracer> tracer_;
    StereoPair pair_;
};

/// A box of which three faces are seen has a good pose; of one or two faces some motions are not observed, and said
/// to be so.
TEST_F(StereoAlignmentTest, ErrorsAreWithinTheCovariance) {
    const int pairs = test::trials(12, 60);
    int good = 0;
    double sum = 0, freedom = 0;
    for (int k = 0; k < pairs; ++k) {
        std::mt19937_64 random(40 + static_cast<std::uint64_t>(k));
        const Rigid3 T = truth(random);
        const Pictures p = pictures(T, painted(random()), random());
        const Rigid3 guess = displaced(T, random_error(2 * kDegree, 0.02 * T.t.z, random));
        const auto e = StereoAlignment(*tracer_, 0).align(pair_, p.left, p.right, guess, 0.25);
        ASSERT_TRUE(e) << e.error().what;
        const CloudEstimate& pose = e->pose;
        EXPECT_TRUE(pose.answer.usable()) << k << ": " << pose.answer.why;
        const ObservedError nees = observed_error(pose.T_lidar_target, pose.covariance, pose.answer, T);
        EXPECT_LT(nees.squared, 30) << k;
        sum += nees.squared, freedom += nees.freedom;
        EXPECT_LE(position_sigma(pose.bound), 1.001 * position_sigma(pose.covariance));
        if (pose.answer.kind != AnswerKind::good) continue;
        ++good;
        const Vector6 error = error_between(pose.T_lidar_target, T);
        EXPECT_LT(error.head<3>().norm(), 0.5 * kDegree) << k;
        EXPECT_LT(error.tail<3>().norm(), 0.005) << k;
    }
    RecordProperty("good", good);
    RecordProperty("nees_over_expected", std::to_string(sum / freedom));
    EXPECT_GE(good, pairs / 4);
    EXPECT_LT(sum / freedom, 1.4);
    EXPECT_GT(sum / freedom, 0.4);
}

TEST_F(StereoAlignmentTest, ATargetWithoutTextureIsRefused) {
    std::mt19937_64 random(1);
    const Rigid3 T{{}, {0, 0, 3}};  // fills the frame: no outline
    const Pictures p = pictures(
        T, [](const Vec3&) { return 1500.0; }, 7);
    const auto e = StereoAlignment(*tracer_, 0).align(pair_, p.left, p.right, T, 0.25);
    ASSERT_TRUE(e) << e.error().what;
    EXPECT_EQ(e->pose.answer.kind, AnswerKind::refused);
    EXPECT_NE(e->pose.answer.why.find("too little texture"), std::string::npos) << e->pose.answer.why;
    EXPECT_FALSE(e->pose.answer.usable());
}

TEST_F(StereoAlignmentTest, AnotherTargetIsNotAGoodAnswer) {
    std::mt19937_64 random(2);
    const Rigid3 T = truth(random);
    const Pictures p = pictures(T, painted(3), 5);
    Scene other;
    other.materials.push_back(test::lambert(0.7F));
    test::add_mesh(other, test::box(1.2, 1.2, 1.2));
    const auto tracer = Tracer::create(other);
    const auto e = StereoAlignment(*tracer, 0).align(pair_, p.left, p.right, T, 0.25);
    ASSERT_TRUE(e) << e.error().what;
    EXPECT_EQ(e->pose.answer.kind, AnswerKind::refused) << e->pose.answer.why;
}

TEST_F(StereoAlignmentTest, ATargetBehindTheCameraIsRefused) {
    const MeasuredImage dark{kPairSize, kPairSize, std::vector<float>(kPairSize * kPairSize, 64)};
    const auto e = StereoAlignment(*tracer_, 0).align(pair_, dark, dark, {{}, {0, 0, -5}}, 0.25);
    ASSERT_TRUE(e) << e.error().what;
    EXPECT_NE(e->pose.answer.why.find("behind the left camera"), std::string::npos) << e->pose.answer.why;
}

/// A match of a hundredth of a pixel is a range error that grows with the square of the range.
TEST_F(StereoAlignmentTest, PointsAreRangesWhoseErrorsGrowWithTheSquareOfTheRange) {
    StereoPoints matches;
    for (const double z : {5.0, 10.0, 20.0}) {
        const double right = 127.5 - kPairFocal_px * kBaseline_m / z;
        StereoPoint p{{127.5, 127.5}, {}, {{right, 127.5}, 1e-4 * Eigen::Matrix2d::Identity()}, {}};
        p.point = triangulate(pair_, exact_pixel(p.left_px), {p.match.px, p.match.covariance_px2});
        p.range_m_per_px = z * z / (kPairFocal_px * kBaseline_m);
        matches.points.push_back(p);
    }
    const auto points = range_points_of(matches, pair_, {.focal = 0.01, .boresight_rad = 1e-3});
    ASSERT_EQ(points.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
        const double z = std::array{5.0, 10.0, 20.0}[i], per_px = z * z / (kPairFocal_px * kBaseline_m);
        EXPECT_NEAR(points[i].range_m, z, 1e-6);
        EXPECT_NEAR(points[i].sigma_m, 0.01 * per_px, 1e-3 * per_px);
        EXPECT_NEAR(points[i].common_m[0], std::hypot(0.01, std::sqrt(2.0) * 0.64) * per_px, 1e-9);
        EXPECT_NEAR(points[i].common_m[1], 0.01 * z, 1e-6);
    }
}

TEST_F(StereoAlignmentTest, MatchesOfAGridMakeADepthMap) {
    const Rigid3 T{{}, {0.2, 0, 6}};
    const Pictures p = pictures(T, painted(3), 5);
    StereoSettings s = stereo_settings_near({T.t, 1.6});
    s.grid_px = 8;
    const auto found = match_stereo(pair_, p.left, p.right, s);
    ASSERT_TRUE(found) << found.error().what;
    EXPECT_EQ(found->counts.accepted, static_cast<int>(found->points.size()));
    EXPECT_GT(found->counts.outside, 10) << "pixels whose rays miss the sphere are not searched";
    EXPECT_GT(found->points.size(), 250U) << to_text(found->counts);
    const std::vector<double> depths = depth_map(*found, kPairSize, kPairSize, 8);
    ASSERT_EQ(depths.size(), static_cast<std::size_t>(kPairSize * kPairSize));
    const Rigid3 T_body_left = inverse(T);
    std::size_t within = 0, filled = 0;
    for (const double z : depths) filled += std::isfinite(z);
    EXPECT_EQ(filled, 64 * found->points.size());
    for (const StereoPoint& m : found->points) {
        EXPECT_EQ(std::fmod(m.left_px.x(), 8) + std::fmod(m.left_px.y(), 8), 0);
        const auto at = static_cast<std::size_t>(m.left_px.y() * kPairSize + m.left_px.x());
        EXPECT_EQ(depths[at], m.point.point_m.z());
        EXPECT_LT((m.point.point_m - to_eigen(T.t)).norm(), 1.6 + 0.2);
        const Vec3 ray = T_body_left.q * normalized(to_vec3(m.point.point_m));
        const Hit hit = tracer_->intersect(BodyPoses(1), {T_body_left.t, ray}, kInfinity);
        within += hit.body >= 0 && std::abs(hit.range_m - m.point.point_m.norm()) < 3 * m.range_sigma_m();
    }
    EXPECT_GT(static_cast<double>(within), 0.8 * static_cast<double>(found->points.size()));
    s.grid_px = -1;
    EXPECT_FALSE(match_stereo(pair_, p.left, p.right, s));
}

}  // namespace
}  // namespace narpa
