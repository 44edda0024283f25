// The pose by rendering and comparing points: convergence, covariance, and saying so where there is nothing to see.
#include <gtest/gtest.h>

#include <random>

#include "base/constants.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/features/feature_matcher.h"
#include "renderer/detector/detector.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

constexpr std::size_t kStation = 0, kChaser = 1;

/// The docking scene with its camera at 320 x 240, before the port.
class FeatureAlignmentTest : public ::testing::Test {
protected:
    void SetUp() override {
        auto read = read_scene(test::build_path("scenes/docking/docking.toml"));
        ASSERT_TRUE(read) << read.error().text();
        scene_ = *std::move(read);
        auto made = RenderScene::create(scene_);
        ASSERT_TRUE(made);
        render_scene_.emplace(*std::move(made));
        camera_ = coarser_camera(scene_.cameras[0], 2);
    }

    /// A frame from x metres before the port, with the detector's noise; `light`: so many times what there is.
    MeasuredImage frame_at(double x_m, std::uint32_t number, int spp = 16, double light = 1) {
        at_ = BodyPoses(scene_.bodies.size());
        at_.set(kStation, scene_.bodies[kStation].initial.T_world_body);
        at_.set(kChaser, {scene_.bodies[kChaser].initial.T_world_body.q, {x_m, 0.03 * x_m, -0.02 * x_m}});
        const Rigid3 T_world_camera = at_.T_world_body[kChaser] * camera_.T_mount_camera;
        truth_ = inverse(T_world_camera) * at_.T_world_body[kStation];
        ModelView view(*render_scene_, camera_, kStation, at_);
        FrameSettings settings;
        settings.spp = spp;
        settings.seed = 77;
        settings.frame = number;
        view.render(truth_, settings, false);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera_.width, camera_.height, camera_.format, camera_.period_ns}));
        Camera exposing = camera_;
        exposing.detector->exposure_s *= light;
        expose(exposing, view.radiance(), 5, number, bytes);
        return *measured_image(camera_, bytes);
    }
    /// So many degrees and per cent of the range off the truth.
    Rigid3 off_by(double amount, std::mt19937_64& random) const {
        std::normal_distribution<double> normal;
        Vector6 e;
        for (int i = 0; i < 6; ++i) e[i] = normal(random);
        e.head<3>() *= amount * kRadPerDeg / e.head<3>().norm();
        e.tail<3>() *= 0.01 * amount * norm(truth_.t) / e.tail<3>().norm();
        return displaced(truth_, e);
    }

    Scene scene_;
    std::optional<RenderScene> render_scene_;
    Camera camera_;
    BodyPoses at_{2};
    Rigid3 truth_{};
};

TEST_F(FeatureAlignmentTest, FindsThePoseFromFiveDegreesAndFivePerCentOff) {
    FeatureAlignment alignment(*render_scene_, camera_, kStation, BodyPoses(2));
    std::mt19937_64 random(3);
    double nees = 0;
    int frames = 0;
    for (const double x_m : {40.0, 20.0, 8.0})
        for (int trial = 0; trial < 2; ++trial, ++frames) {
            const MeasuredImage frame = frame_at(x_m, static_cast<std::uint32_t>(trial));
            const FeatureEstimate e = alignment.align(frame, at_, off_by(5, random));
            ASSERT_TRUE(e.answer.usable()) << x_m << " m: " << name(e.status);
            const Vector6 error = error_between(e.T_camera_target, truth_);
            EXPECT_LT(error.head<3>().norm(), 0.2 * kRadPerDeg) << x_m;
            EXPECT_LT(error.tail<3>().norm(), 2e-3 * norm(truth_.t)) << x_m;
            EXPECT_GT(e.agreeing, 30);
            EXPECT_LT(e.rounds.back().after_px, 0.2);
            EXPECT_LT(e.rounds.back().after_px, 0.1 * e.rounds.front().before_px);
            nees += normalised_error_squared(error, e.covariance);
            EXPECT_LT(e.bound.trace(), e.covariance.trace()) << "the sensor's noise is part of it";
        }
    // Six degrees of freedom, of few frames: the covariance is not off by more than a factor of three in variance.
    EXPECT_LT(nees / frames, 18);
}

/// Edges of frames of one sample a pixel are where those of the views are: seen through a tone curve the target
/// was too far away by 3e-4 of the range, in all frames alike.
TEST_F(FeatureAlignmentTest, HasNoBiasInFramesOfOneSampleAPixel) {
    FeatureAlignment alignment(*render_scene_, camera_, kStation, BodyPoses(2));
    constexpr int kFrames = 24;
    double sum = 0;
    for (int i = 0; i < kFrames; ++i) {
        const MeasuredImage frame = frame_at(24 + 0.11 * i, static_cast<std::uint32_t>(i), 1);
        const FeatureEstimate e = alignment.align(frame, at_, truth_);
        ASSERT_TRUE(e.answer.usable()) << i;
        sum += (e.T_camera_target.t.z - truth_.t.z) / truth_.t.z / kFrames;
    }
    EXPECT_NEAR(sum, 0, 1.5e-4);
}

/// Optical flow alone takes the difference of brightness for motion.
TEST_F(FeatureAlignmentTest, IsAsGoodWhereTheFrameIsDarkerOrBrighterThanTheModel) {
    FeatureAlignment alignment(*render_scene_, camera_, kStation, BodyPoses(2));
    const auto error_with = [&](double light) {
        std::mt19937_64 random(3);
        double sum = 0;
        for (const double x_m : {40.0, 20.0, 8.0}) {
            const MeasuredImage frame = frame_at(x_m, 7, 16, light);
            const FeatureEstimate e = alignment.align(frame, at_, off_by(3, random));
            EXPECT_TRUE(e.answer.usable()) << light << ", " << x_m << " m: " << name(e.status);
            const Vector6 error = error_between(e.T_camera_target, truth_);
            EXPECT_LT(normalised_error_squared(error, e.covariance), 20) << light << ", " << x_m << " m";
            sum += error.tail<3>().norm() / norm(truth_.t);
        }
        return sum;
    };
    const double exact = error_with(1);
    for (const double light : {0.6, 1.3}) EXPECT_LT(error_with(light), 2 * exact) << light;
}

TEST_F(FeatureAlignmentTest, IsDeterministic) {
    const MeasuredImage frame = frame_at(20, 1);
    std::mt19937_64 random(4);
    const Rigid3 guess = off_by(3, random);
    FeatureAlignment one(*render_scene_, camera_, kStation, BodyPoses(2)),
        other(*render_scene_, camera_, kStation, BodyPoses(2));
    (void)other.align(frame_at(10, 2), at_, guess);  // what it saw before does not matter
    const MeasuredImage again = frame_at(20, 1);
    EXPECT_EQ(frame.dn, again.dn);
    EXPECT_EQ(one.align(frame, at_, guess).T_camera_target, other.align(frame, at_, guess).T_camera_target);
}

TEST_F(FeatureAlignmentTest, ReportsThatThereIsNothingToMatch) {
    FeatureAlignment alignment(*render_scene_, camera_, kStation, BodyPoses(2));
    MeasuredImage dark = frame_at(20, 1);
    std::fill(dark.dn.begin(), dark.dn.end(), 64.f);
    EXPECT_EQ(alignment.align(dark, at_, truth_).status, FeatureStatus::few_matches);
    // The guess has the target behind the camera.
    Rigid3 behind = truth_;
    behind.t.z = -behind.t.z;
    EXPECT_EQ(alignment.align(frame_at(20, 1), at_, behind).status, FeatureStatus::few_matches);
}

/// A corner of light, followed under noise: its place scatters as predicted.
TEST(FlowNoise, ScattersAsPredicted) {
    constexpr int kSize = 64;
    SensorModel sensor;
    sensor.top_dn = 4095, sensor.black_dn = 64, sensor.read_dn2 = 16, sensor.shot_dn = 0.2,
    sensor.rounding_dn2 = 1.0 / 12;
    const auto light = [](double x, double y) {
        const auto edge = [](double d) { return 1 / (1 + std::exp(-1.5 * d)); };
        return 400 + 2000 * edge(x - 31.3) * edge(y - 31.7);
    };
    std::mt19937_64 random(8);
    std::normal_distribution<double> normal;
    RadianceImage view(kSize, kSize);
    sensor.dn_per_radiance = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    for (int y = 0; y < kSize; ++y)
        for (int x = 0; x < kSize; ++x) {
            const auto v = static_cast<float>(light(x, y) - sensor.black_dn);
            view.pixels[static_cast<std::size_t>(y * kSize + x)] = {v, v, v};
        }
    const std::vector<std::uint8_t> everywhere(kSize * kSize, 255);
    double predicted = 0, measured = 0, mean_u = 0, mean_v = 0;
    std::vector<FeatureMatch> all;
    constexpr int kTrials = 300;
    for (int trial = 0; trial < kTrials; ++trial) {
        MeasuredImage frame{kSize, kSize, {}};
        for (int y = 0; y < kSize; ++y)
            for (int x = 0; x < kSize; ++x) {
                const double dn = light(x, y);
                frame.dn.push_back(static_cast<float>(dn + std::sqrt(sensor.variance_dn2(dn)) * normal(random)));
            }
        const ByteScale scale(frame, sensor);
        const ByteImage in_view = scale.scaled(view), in_frame = scale.scaled(frame);
        const auto matches = match_corners(in_view, in_frame, everywhere, 1, false).matches;
        ASSERT_EQ(matches.size(), 1u);
        all.push_back(matches[0]);
        mean_u += matches[0].frame_u / kTrials, mean_v += matches[0].frame_v / kTrials;
        predicted += flow_covariance(in_view, in_frame, matches[0]).trace();
    }
    for (const FeatureMatch& m : all) measured += std::pow(m.frame_u - mean_u, 2) + std::pow(m.frame_v - mean_v, 2);
    EXPECT_NEAR(measured / predicted, 1, 0.25);
}

}  // namespace
}  // namespace narpa
