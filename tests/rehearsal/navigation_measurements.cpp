// Pose measurements from rendered frames and simulated sweeps of the docking.
#include <gtest/gtest.h>

#include "base/constants.h"
#include "protocols/video/embedded_line.h"
#include "rehearsal/navigation/estimation/measurements.h"
#include "rehearsal/navigation/sensor_inputs.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/rehearsal/simulated_sensors.h"
#include "tests/support/paths.h"

namespace narpa::rehearsal {
namespace {

struct Stage {
    Scenario scenario;
    std::unique_ptr<SceneModel> model;
};

/// The scene is read once.
Stage& stage() {
    static Stage s = [] {
        auto scenario = read_scenario(test::build_path("scenes/rehearsal/docking.toml"));
        EXPECT_TRUE(scenario) << scenario.error().text();
        auto model = SceneModel::create(*scenario);
        EXPECT_TRUE(model) << model.error().text();
        return Stage{*scenario, *std::move(model)};
    }();
    return s;
}

Plant plant_at(const Vec3& port_m, const Vec3& off_rad) {
    Plant plant{stage().scenario};
    plant.stand(port_m, off_rad);
    return plant;
}

Rigid3 beside(const Rigid3& T) {
    Vector6 e;
    e << 0.5 * kRadPerDeg, -0.4 * kRadPerDeg, 0.3 * kRadPerDeg, 0.15, -0.1, 0.1;
    return displaced(T, e);
}

Prediction predicted(const Plant& plant, const Rigid3& T_chaser_target) {
    return {.q_world_chaser = plant.motion.q_world_chaser,
            .T_chaser_target = T_chaser_target,
            .position_sigma_m = 0.1,
            .rotation_sigma_rad = 0.2 * kRadPerDeg};
}

struct MethodCase {
    std::string name;
    double far_m;  ///< lamps of a pixel's size are not seen from further away
    int fewest_points;
    double part_of_range;  ///< largest error
    std::string why_in_the_dark;
};
void PrintTo(const MethodCase& c, std::ostream* out) {
    *out << c.name;
}
class CameraMethods : public testing::TestWithParam<MethodCase> {
protected:
    CameraPoseEstimator estimator_{*stage().model, stage().model->cameras()[0],
                                   *find_camera_method(GetParam().name), 1};
};
INSTANTIATE_TEST_SUITE_P(Of, CameraMethods,
                         testing::Values(MethodCase{"features", 25, 30, 2e-3, "few matches"},
                                         MethodCase{"dense", 25, 30, 2e-3, "does not fit"},
                                         MethodCase{"marks", 9, 5, 4e-3, "marks in view"}),
                         [](const auto& p) { return p.param.name; });

TEST(CameraMethods, AreAllTested) {
    EXPECT_EQ(camera_methods().size(), 3u);
}

TEST_P(CameraMethods, MeasureTheTruePose) {
    std::uint32_t number = 0;
    for (const double x_m : {GetParam().far_m, 6.0}) {
        const Plant plant = plant_at({x_m, 0.3, -0.2}, {0.01, -0.02, 0.01});
        const Rigid3 truth = chaser_target(plant);
        const auto bytes = frame(*stage().model, plant, ++number, 16);
        const MeasurementResult s = estimator_.measure(bytes, 0, predicted(plant, beside(truth)));
        ASSERT_TRUE(s.pose) << s.why;
        EXPECT_GT(s.points, GetParam().fewest_points);
        const Rigid3 T_camera_target = inverse(s.pose->T_chaser_sensor) * truth;
        const Vector6 error = error_between(s.pose->T_sensor_target, T_camera_target);
        EXPECT_LT(normalised_error_squared(error, s.pose->covariance), 27.9) << x_m;
        EXPECT_LT(error.tail<3>().norm(), GetParam().part_of_range * x_m);
    }
}

// The scenes are written by hand, each with the marks of the one station.
TEST(Marks, OfBothDockingScenesAreTheSame) {
    const auto docking = read_scene(test::build_path("scenes/docking/docking.toml"));
    ASSERT_TRUE(docking) << docking.error().text();
    const std::vector<Mark>&a = docking->bodies[0].marks, &b = stage().model->scene().bodies[0].marks;
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].name, b[i].name);
        EXPECT_EQ(norm(a[i].T_body_mark.t - b[i].T_body_mark.t), 0) << a[i].name;
        EXPECT_EQ(a[i].radius_m, b[i].radius_m) << a[i].name;
    }
}

TEST_P(CameraMethods, RefuseAFrameThatTheCameraRepeats) {
    const Plant plant = plant_at({0.8 * GetParam().far_m, 0, 0}, {});
    const Prediction prediction = predicted(plant, chaser_target(plant));
    const auto first = frame(*stage().model, plant, 3, 16), second = frame(*stage().model, plant, 4, 16);
    EXPECT_TRUE(estimator_.measure(first, 0, prediction).pose);
    EXPECT_TRUE(estimator_.measure(second, 1'000'000'000, prediction).pose) << "at rest, but with other noise";
    const MeasurementResult again = estimator_.measure(first, 2'000'000'000, prediction);
    EXPECT_FALSE(again.pose);
    EXPECT_EQ(again.answer, AnswerKind::refused);
    EXPECT_EQ(again.why, "its image is the same, byte for byte, as 2 frames before: the camera repeats it");
}

TEST(FrameHistory, WithoutNoiseOnlyWhatHasMovedMustLookDifferent) {
    Camera camera = stage().model->scene().cameras[stage().model->cameras()[0]];
    camera.detector.reset();
    FrameHistory history(camera);
    const std::vector<std::uint8_t> bytes(100, 7);
    Rigid3 T{{}, {0, 0, 20}};
    EXPECT_EQ(history.staleness(bytes, 0, T), "");
    EXPECT_EQ(history.staleness(bytes, 1, T), "");
    T.t.z += 1;
    EXPECT_NE(history.staleness(bytes, 2, T), "");
}

TEST(FrameHistory, AnEmbeddedLineStatesTheTime) {
    Camera camera = stage().model->scene().cameras[stage().model->cameras()[0]];
    camera.embedded_line = true;
    camera.width = 200, camera.height = 2;
    FrameHistory history(camera);
    std::vector<std::uint8_t> bytes(400);
    FrameLedger ledger;
    ledger.t_exposure_mid_ns = 5'000'000'000;
    ASSERT_TRUE(encode_embedded_line(ledger, std::span(bytes).last(200)));
    EXPECT_EQ(history.staleness(bytes, 5'000'000'000, {}), "");
    bytes[0] = 1;
    EXPECT_EQ(history.staleness(bytes, 7'500'000'000, {}),
              "it is a frame of another time: its embedded line says -2.500 s");
}

TEST_P(CameraMethods, GiveAReasonWithoutAPose) {
    const Plant plant = plant_at({20, 0, 0}, {});
    const Rigid3 truth = chaser_target(plant);
    auto bytes = frame(*stage().model, plant, 9);
    std::fill(bytes.begin(), bytes.end(), std::uint8_t{4});  // the Earth's shadow
    const MeasurementResult dark = estimator_.measure(bytes, 0, predicted(plant, truth));
    EXPECT_FALSE(dark.pose);
    EXPECT_NE(dark.why.find(GetParam().why_in_the_dark), std::string::npos) << dark.why;
    bytes.pop_back();
    EXPECT_FALSE(estimator_.measure(bytes, 0, predicted(plant, truth)).why.empty());
}

TEST(LidarPoseEstimator, MeasuresThePoseWhileTheChaserMoves) {
    LidarPoseEstimator estimator(*stage().model, stage().model->lidars()[0]);
    Plant plant = plant_at({15, 0.5, -0.3}, {0.01, 0.02, -0.01});
    plant.motion.chaser_rate_rad_s = plant.motion.chaser_rate_rad_s + Vec3{0.01, -0.02, 0.03};
    plant.motion.velocity_m_s = plant.motion.velocity_m_s + Vec3{-0.4, 0.1, 0.05};
    plant.t_s = 10;
    const std::int64_t epoch = stage().model->scene().epoch_unix_ns;
    SweepBuffer buffer(estimator.lidar(), epoch);
    for (const auto& bytes : turn(*stage().model, plant, epoch)) ASSERT_TRUE(buffer.take(bytes, 10'000'000'000));
    const auto t_ns = std::llround(1e9 * plant.t_s);
    LidarSweep sweep;
    buffer.turn(t_ns, sweep);
    ASSERT_GT(sweep.points.size(), 500u);
    ASSERT_GT(sweep.empty.size(), 10'000u);

    // As the chaser sees the target move.
    const Rigid3 truth = chaser_target(plant);
    Plant later = plant;
    later.step({}, {}, 1e-3);
    const Vector6 rate = error_between(truth, chaser_target(later)) / 1e-3;
    const ApparentMotion motion{to_vec3(rate.tail<3>()), to_vec3(rate.head<3>())};
    Prediction before = predicted(plant, beside(truth));
    before.motion = motion;
    const MeasurementResult s = estimator.measure(sweep, t_ns, before);
    ASSERT_TRUE(s.pose) << s.why;
    const Vector6 error = error_between(s.pose->T_sensor_target, inverse(s.pose->T_chaser_sensor) * truth);
    EXPECT_LT(error.head<3>().norm(), 0.02 * kRadPerDeg);
    EXPECT_LT(error.tail<3>().norm(), 3e-3);
    EXPECT_LT(normalised_error_squared(error, s.pose->covariance), 22.5);
    // Without motion correction the turn does not fit the model, and the reason is given.
    before.motion = {};
    const MeasurementResult still = estimator.measure(sweep, t_ns, before);
    EXPECT_FALSE(still.pose);
    EXPECT_NE(still.why.find("points lie on the model"), std::string::npos) << still.why;
}

TEST(LidarPoseEstimator, GivesAReasonWithoutAPose) {
    LidarPoseEstimator estimator(*stage().model, stage().model->lidars()[0]);
    const Plant plant = plant_at({15, 0, 0}, {});
    const MeasurementResult s = estimator.measure({}, 0, predicted(plant, chaser_target(plant)));
    EXPECT_FALSE(s.pose);
    EXPECT_NE(s.why.find("points meet the target"), std::string::npos) << s.why;
}

TEST(SceneModel, TheEarthFollowsTheOrbit) {
    SceneModel& model = *stage().model;
    const Orbit& orbit = stage().scenario.orbit;
    const double half_s = 3.14159265358979323846 / orbit.rate_rad_s();
    const auto earth_z = [&](double t_s) { return model.place(t_s, {}, {}).T_world_body[2].t.z; };
    EXPECT_NEAR(earth_z(0), -orbit.radius_m, 1);
    EXPECT_NEAR(earth_z(half_s), orbit.radius_m, 1);
}

}  // namespace
}  // namespace narpa::rehearsal
