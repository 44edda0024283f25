// Frames that are exposed over time while the target moves, through a lens that distorts and blurs: the estimators
// find the pose of mid-exposure.
#include <gtest/gtest.h>

#include <cmath>

#include "base/constants.h"
#include "estimator/dense/dense_alignment.h"
#include "estimator/features/feature_alignment.h"
#include "estimator/pnp/pnp.h"
#include "renderer/detector/detector.h"
#include "tests/estimator/pnp/pnp_support.h"
#include "tests/support/cameras.h"
#include "tests/support/campaign.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

TEST(RowTimes, OfCoarserAndFinerRowsHaveTheSameMiddles) {
    const RowTimes rows{-0.05, 1e-3, 4e-3};
    const RowTimes coarse = rows.scaled(4), fine = rows.scaled(1.0 / 3);
    EXPECT_NEAR(coarse.at(5), 0.25 * (rows.at(20) + rows.at(21) + rows.at(22) + rows.at(23)), 1e-15);
    EXPECT_NEAR(coarse.exposure_s, 7e-3, 1e-15);
    EXPECT_NEAR(fine.at(3 * 7 + 1), rows.at(7), 1e-15);
    EXPECT_NEAR(fine.row_s, 1e-3 / 3, 1e-15);
    EXPECT_NEAR(rows.from(12).at(3), rows.at(15), 1e-15);
    double sum = 0;
    for (int k = 0; k < 5; ++k) sum += rows.part(k, 5).at(9) / 5;
    EXPECT_NEAR(sum, rows.at(9), 1e-15);
    EXPECT_NEAR(rows.part(0, 5).exposure_s, 4e-3 / 5, 1e-15);
}

TEST(RowTimes, OfTheCameraAreAboutMidExposure) {
    Camera c = camera(64, 49, 100);
    EXPECT_TRUE(row_times(c).at_once());
    c.detector = Detector{.exposure_s = 0.01};
    EXPECT_TRUE(row_times(c).at_once());
    c.shutter = Shutter{2'000'000};
    EXPECT_NEAR(row_times(c).at(24), 0, 1e-15);
    EXPECT_NEAR(row_times(c).at(0), -0.048, 1e-15);
    EXPECT_EQ(row_times(c).exposure_s, 0.01);
}

/// Of a window of the image too, each row is seen from where the camera is in the middle of its exposure.
TEST(CameraPath, IsAtEachRowWhereTheMotionHasIt) {
    const Rigid3 T_world_target{normalized(Quat{0.9, 0.1, 0.2, -0.3}), {4, -2, 1}};
    const Rigid3 T{normalized(Quat{0.8, 0.3, -0.2, 0.4}), {0.5, -0.3, 9}};
    const ApparentMotion motion{{0.1, -0.05, 0.12}, {0.02, 0.05, -0.03}};
    const RowTimes window = RowTimes{-0.05, 1e-3, 4e-3}.from(30);
    const CameraPose path = camera_path(T_world_target, T, motion, window, 40);
    for (const int row : {0, 17, 39}) {
        const Rigid3 there = path.at(path.time(row, 40, 0.5));
        const Rigid3 wanted = T_world_target * inverse(moved(T, motion, window.at(row)));
        EXPECT_LT(norm(there.t - wanted.t), 1e-5);  // its path is taken for straight
        EXPECT_LT(angle_between(there.q, wanted.q), 1e-7);
    }
}

/// Points from a rolling shutter: two solutions and the motion give the pose of mid-exposure to its bound.
TEST(PointsFromARollingShutter, GiveThePoseOfMidExposure) {
    std::mt19937_64 random(3);
    const RowTimes times{-249.5e-4, 1e-4, 2e-3};
    PnpSolver solver(50);
    constexpr int kTrials = 200;
    double known = 0, ignored = 0;
    for (int trial = 0; trial < kTrials; ++trial) {
        const Rigid3 truth{random_attitude(random), {0.3, -0.2, 12}};
        const ApparentMotion motion{0.5 * random_direction(random), 0.087 * random_direction(random)};  // 5 deg/s
        Seen seen = see(random, random_points(random, 50, 1.5), truth, 0.3);
        for (std::size_t i = 0; i < seen.pixels.size(); ++i) {
            Pixel p = seen.pixels[i];
            const Pixel exact = project(seen.camera, truth * seen.body_m[i]);
            const double noise_u = p.u - exact.u, noise_v = p.v - exact.v;
            for (int k = 0; k < 4; ++k) {  // the row depends on the time, and that on the row
                p = project(seen.camera, moved(truth, motion, times.at(p.v)) * seen.body_m[i]);
            }
            seen.pixels[i] = {p.u + noise_u, p.v + noise_v};
        }
        const auto bound = pnp_bound(seen.input(), truth);
        ASSERT_TRUE(bound);
        const auto solve = [&](const std::vector<Vec3>& points) {
            PnpInput input = seen.input();
            input.body_m = points;
            input.sigma_px = 0.3;
            return solver.solve(input).fit.T_camera_body;
        };
        const Rigid3 first = solve(seen.body_m);
        std::vector<Vec3> points = seen.body_m;
        to_mid_exposure(first, motion, times, seen.pixels, points);
        known += normalised_error_squared(error_between(truth, solve(points)), *bound) / kTrials;
        ignored += normalised_error_squared(error_between(truth, first), *bound) / kTrials;
    }
    EXPECT_LT(known, 6 + 3 * std::sqrt(12.0 / kTrials));
    EXPECT_GT(ignored, 30);
}

struct Exposing {
    const char* name;
    std::int64_t row_ns;
    double exposure_s;
    bool distorts, blurs;
    double ignored;  ///< normalised squared error without the shutter, at least
};

class ExposedOverTime : public testing::TestWithParam<Exposing> {
protected:
    void SetUp() override {
        auto made = RenderScene::create(scene);
        ASSERT_TRUE(made);
        at.set(0, truth);
        render_scene.emplace(std::move(*made));
        camera.format = PixelFormat::y16;
        camera.detector = Detector{.exposure_s = GetParam().exposure_s, .full_well_e = 20000, .read_noise_e = 60};
        camera.detector->black_level_dn = 200;
        camera.detector->shot_noise = true;
        camera.detector->bits = 14;
        camera.detector->quantum_efficiency = 2e-3 * 0.04 / GetParam().exposure_s;
        camera.shutter = Shutter{GetParam().row_ns};
        if (GetParam().distorts)
            camera.model = test::brown_conrady(test::pinhole_of(camera), {-0.35, 0.15, 1e-3, -8e-4, -0.03});
        if (GetParam().blurs) camera.optics.point_spread = PointSpreadFunction{.sigma_px = 0.8};
    }
    /// A frame of a camera that moves as `velocity` and `rate`, world axes, have it.
    void take(std::uint32_t number) {
        const RowTimes times = row_times(camera);
        const double half_s = 0.5 * (times.exposure_s + (camera.height - 1) * times.row_s);
        const auto T_world_camera = [&](double t_s) { return Rigid3{exp_rotation(t_s * rate), t_s * velocity}; };
        const CameraPose path{T_world_camera(-half_s), T_world_camera(half_s), 0.5 * times.row_s / half_s};
        FrameSettings settings;
        settings.spp = 64;
        settings.seed = 5;
        settings.frame = number;
        RadianceImage radiance(camera.width, camera.height);
        Aovs aovs;
        render_radiance(*render_scene, at, camera, path, settings, radiance, &aovs);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(camera, radiance, 3, number, bytes);
        frame = *measured_image(camera, bytes);
        const auto& [r, g, b] = sensor_model(camera).dn_per_radiance;
        variance_dn2 = aovs.variance;
        for (float& v : variance_dn2) v *= static_cast<float>((r + g + b) * (r + g + b));
    }
    [[nodiscard]] Rigid3 guess() const {
        Vector6 e;
        e << 2 * kRadPerDeg * Eigen::Vector3d(0.6, -0.5, 0.62), 0.08 * Eigen::Vector3d(-0.5, 0.4, 0.7);
        return displaced(truth, e);
    }

    const Scene scene = sunlit_bumpy_body();
    Camera camera = test::camera(120, 90, 128);
    std::optional<RenderScene> render_scene;
    BodyPoses at{1};
    Rigid3 truth{normalized(Quat{0.8, 0.3, -0.2, 0.4}), {0.4, -0.2, 4}};
    const Vec3 velocity{-0.36, -0.18, 0.2}, rate{-0.008, -0.013, -0.009};  // 1 deg/s
    const ApparentMotion motion{-velocity - cross(rate, truth.t), -rate};
    MeasuredImage frame;
    std::vector<float> variance_dn2;  ///< of the frame's own sampling noise
};

TEST_P(ExposedOverTime, DenseAlignmentReachesItsBound) {
    Camera still = camera;
    still.shutter.reset();
    DenseAlignment dense(*render_scene, camera, 0), ignoring(*render_scene, still, 0);
    DenseOptions options;
    options.motion = motion;
    options.samples_per_pixel = 128;  // four times the frame's samples: few enough errors of its own
    const int frames = test::trials(1, 3);
    double over_bound = 0, ignored = 0;
    for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(frames); ++k) {
        take(k);
        const auto e = dense.align(frame, at, guess(), options, variance_dn2);
        ASSERT_TRUE(e) << e.error().text();
        ASSERT_EQ(e->status, DenseStatus::converged) << name(e->status);
        const auto bound = dense.bound(at, truth, options, variance_dn2);
        ASSERT_TRUE(bound) << bound.error().text();
        over_bound += normalised_error_squared(error_between(truth, e->T_camera_body), *bound) / frames;
        const auto i = ignoring.align(frame, at, guess(), options, variance_dn2);
        ASSERT_TRUE(i);
        ignored += normalised_error_squared(error_between(truth, i->T_camera_body), *bound) / frames;
    }
    EXPECT_LT(over_bound, 6 + 4 * std::sqrt(12.0 / frames));
    EXPECT_GT(ignored, GetParam().ignored);
}

TEST_P(ExposedOverTime, FeatureAlignmentFindsThePose) {
    take(0);
    FeatureAlignment features(*render_scene, camera, 0, at);
    const auto error = [&](const ApparentMotion& m) {
        const FeatureEstimate e = features.align(frame, at, guess(), m);
        EXPECT_TRUE(e.answer.usable()) << e.answer.why;
        return error_between(truth, e.T_camera_target);
    };
    const Vector6 found = error(motion), ignored = error({});
    EXPECT_LT(found.head<3>().norm(), 0.15 * kRadPerDeg);
    EXPECT_LT(found.tail<3>().norm(), 4e-3);
    if (GetParam().row_ns > 0) {
        EXPECT_LT(found.head<3>().norm(), 0.6 * ignored.head<3>().norm());
    }
}

INSTANTIATE_TEST_SUITE_P(, ExposedOverTime,
                         testing::Values(Exposing{"global", 0, 0.08, false, false, 20},
                                         Exposing{"rolling", 800'000, 0.002, false, false, 1e3},
                                         Exposing{"all", 500'000, 0.02, true, true, 100}),
                         [](const auto& exposing) { return exposing.param.name; });

}  // namespace
}  // namespace narpa
