// Between the sensors' body axes and the filter: covariances, known thrust, contact; attitudes and packets in
// between.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "protocols/lidar/velodyne.h"
#include "rehearsal/navigation/estimation/state_estimator.h"
#include "rehearsal/navigation/sensor_inputs.h"
#include "tests/rehearsal/navigation_plant.h"
#include "tests/rehearsal/simulated_sensors.h"

namespace narpa::rehearsal {
namespace {

AttitudeReport attitude(const Plant& plant) {
    return {0, std::llround(1e9 * plant.t_s), plant.motion.q_world_chaser, plant.motion.chaser_rate_rad_s};
}

/// Random errors of the measurement and the star tracker, propagated to the centres of mass.
TEST(CentresOfMass, TheCovarianceIsThatOfRandomDraws) {
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    const Vec3 chaser_centre{-3, 0.2, 0.1}, target_centre{-12, 1, 0.5};
    const Rigid3 T_chaser_sensor{exp_rotation({0.3, 1.2, -0.4}), {-0.5, 0.1, 2}};
    const Rigid3 T_sensor_target{exp_rotation({0.4, -0.2, 2}), {1, -2, 20}};
    const Quat q_frame_chaser = exp_rotation({1, 0.3, -0.7});
    Vector6 sigma;
    sigma << 1e-3, 2e-3, 5e-4, 0.01, 0.02, 0.05;
    constexpr double kStar = 1e-3;
    TargetMeasurement measurement{0, T_sensor_target, sigma.cwiseAbs2().asDiagonal(), T_chaser_sensor};
    const PoseMeasurement m = at_centres_of_mass(measurement, chaser_centre, target_centre, q_frame_chaser, kStar);
    // Where the filter has the target's mass: in frame axes, by the attitude it believes.
    const auto masses = [&](const Rigid3& T, const Vec3& star) {
        const Rigid3 seen = T_chaser_sensor * T * Rigid3{{}, target_centre};
        const Quat q = q_frame_chaser * exp_rotation(star);
        return Rigid3{q * seen.q, q * (seen.t - chaser_centre)};
    };
    const Rigid3 truth = masses(T_sensor_target, {});
    Matrix6 sum = Matrix6::Zero();
    constexpr int kDraws = 20000;
    for (int i = 0; i < kDraws; ++i) {
        Vector6 e;
        for (int k = 0; k < 6; ++k) e[k] = sigma[k] * normal(random);
        const Vec3 star{kStar * normal(random), kStar * normal(random), kStar * normal(random)};
        const Vector6 off = error_between(truth, masses(displaced(T_sensor_target, e), star));
        sum += off * off.transpose() / kDraws;
    }
    const Matrix6 expected = covariance_in_other_axes(q_frame_chaser * T_chaser_sensor.q, m.covariance);
    for (int i = 0; i < 6; ++i)
        for (int k = 0; k < 6; ++k)
            EXPECT_NEAR(sum(i, k), expected(i, k), 0.05 * std::sqrt(expected(i, i) * expected(k, k))) << i << k;
}

struct Estimated {
    Plant plant;
    std::optional<StateEstimator> estimator;
    explicit Estimated(const Scenario& scenario = docking_scenario()) : plant{scenario} {
        plant.stand(plant.scenario.start.position_m, {0.02, -0.01, 0.03});
        auto made = StateEstimator::create(plant.scenario, 0, attitude(plant));
        EXPECT_TRUE(made);
        estimator.emplace(*std::move(made));
    }
    [[nodiscard]] double off_m() const {
        return norm(estimator->estimate().T_chaser_target.t - chaser_target(plant).t);
    }
    void fly(const Impulses& impulses) {
        const auto t_ns = std::llround(1e9 * plant.t_s);
        estimator->thrust(t_ns, impulses.linear_n_s);
        plant.fly(impulses, 1);
        estimator->take(attitude(plant));
        estimator->advance(t_ns + 1'000'000'000);
    }
};

Scenario docking_from(const Vec3& port_m, const Vec3& velocity_m_s) {
    Scenario s = docking_scenario();
    s.start.position_m = port_m;
    s.start.velocity_m_s = velocity_m_s;
    return s;
}

PortState port_state(const Estimated& e) {
    return port_state(e.estimator->motion(), e.plant.scenario.target, e.plant.scenario.chaser);
}

TEST(StateEstimator, StartsWhereTheScenarioDoes) {
    const Estimated e;
    EXPECT_LT(e.off_m(), 1e-9);
    EXPECT_LT(angle_between(e.estimator->estimate().T_chaser_target.q, chaser_target(e.plant).q), 1e-9);
    // Of the start, 0.5 m in x and 0.4 m beside it; chaser's axes point the other way.
    const Matrix6 C = e.estimator->estimate().covariance;
    EXPECT_NEAR(std::sqrt(C(3, 3)), 0.5, 0.03);
}

TEST(StateEstimator, FollowsThrust) {
    Estimated e;
    for (int k = 0; k < 20; ++k)
        e.fly({{k % 2 ? 150.0 : -40.0, 25.0, k < 10 ? 399.0 : -60.0}, {0, 20.0 * (k % 3 - 1), 0}});
    EXPECT_GT(norm(e.plant.port().T_port_chaser_port.t - e.plant.scenario.start.position_m), 1);
    EXPECT_LT(e.off_m(), 0.01) << "it fires and turns, and the pulses' edges lie between the plant's steps";
    const Vec3 v = e.estimator->motion().velocity_m_s - e.plant.motion.velocity_m_s;
    EXPECT_LT(norm(v), 1e-3);
}

TEST(StateEstimator, ComputesTheMotionDuringASweep) {
    Estimated e;
    e.plant.motion.chaser_rate_rad_s = {0.01, -0.02, 0.03};
    e.plant.motion.velocity_m_s = {0.3, -0.2, 0.1};
    const RelativeState state = in_frame(e.plant.motion, e.plant.scenario.orbit, 0);
    auto filter = StateEstimator::create(e.plant.scenario, 0, attitude(e.plant));
    ASSERT_TRUE(filter);
    // The estimator is at rest relative to the port; the chaser's rate is the gyroscope's.
    const ApparentMotion motion = filter->motion_in_chaser();
    const Rigid3 before = filter->estimate().T_chaser_target;
    const Rigid3 after = filter->predicted(10'000'000);
    const Vector6 moved = error_between(before, after) / 0.01;
    EXPECT_LT(norm(to_vec3(moved.head<3>()) - motion.rate_rad_s), 1e-4);
    EXPECT_LT(norm(to_vec3(moved.tail<3>()) - motion.velocity_m_s), 1e-2);
    EXPECT_GT(norm(state.velocity_m_s), 0.3);
}

/// However many measurements there are, what they have in common stays.
TEST(StateEstimator, ReportsTheErrorsOfTheModelThatTheNewestMeasurementHas) {
    Estimated e;
    TargetMeasurement seen;
    seen.T_chaser_sensor = {exp_rotation({0, 0, 0.5 * kPi}), {0.5, 0, 0}};
    seen.T_sensor_target = inverse(seen.T_chaser_sensor) * chaser_target(e.plant);
    seen.covariance = 1e-6 * Matrix6::Identity();
    EXPECT_EQ(e.estimator->take(seen).outcome, UpdateOutcome::taken);
    const Matrix6 without = e.estimator->estimate().covariance;
    seen.covariance_of_model.diagonal() << 1e-4, 0, 0, 0, 4e-2, 0;  // sensor axes: x is the chaser's y, y its -x
    EXPECT_EQ(e.estimator->take(seen).outcome, UpdateOutcome::taken);
    const Vector6 more = (e.estimator->estimate().covariance - without).diagonal();
    EXPECT_NEAR(more[1], 1e-4, 2e-6);
    EXPECT_NEAR(more[3], 4e-2, 1e-4);
    EXPECT_LT(std::abs(more[0]) + std::abs(more[4]), 1e-4);
}

TEST(StateEstimator, RestartsAfterRepeatedContradictions) {
    Estimated e;
    TargetMeasurement seen;
    Rigid3 T = chaser_target(e.plant);
    T.t.y += 8;
    seen.T_sensor_target = T;
    seen.covariance = 1e-4 * Matrix6::Identity();
    for (int k = 0; k < 4; ++k) EXPECT_EQ(e.estimator->take(seen).outcome, UpdateOutcome::gated);
    EXPECT_EQ(e.estimator->restarts(), 0u);
    EXPECT_EQ(e.estimator->take(seen).outcome, UpdateOutcome::taken);
    EXPECT_EQ(e.estimator->restarts(), 1u);
    EXPECT_LT(norm(e.estimator->estimate().T_chaser_target.t - T.t), 1e-6);
}

TEST(StateEstimator, IsAtRestAtThePortAfterCapture) {
    Estimated e(docking_from({0.04, 0.01, -0.02}, {-0.075, 0, 0}));
    e.estimator->on_contact(1'000'000'000, true);
    const PortState port = port_state(e);
    EXPECT_NEAR(port.T_port_chaser_port.t.x, 0, 1e-9);
    EXPECT_NEAR(port.T_port_chaser_port.t.y, 0.01, 1e-3);
    EXPECT_LT(norm(port.velocity_m_s), 1e-9);
}

TEST(StateEstimator, HasAnUncertainSpeedAfterABounce) {
    Estimated e(docking_from({0.2, 0.01, -0.02}, {-0.2, 0.01, 0}));
    e.estimator->on_contact(1'000'000'000, false);
    const PortState port = port_state(e);
    EXPECT_NEAR(port.T_port_chaser_port.t.x, 0, 1e-3);
    EXPECT_NEAR(port.velocity_m_s.x, 0, 1e-9);
    EXPECT_NEAR(port.velocity_m_s.y, 0.01, 1e-3);
    // Seen for two seconds where a bounce of half its speed takes it: that contradicts nothing, and is believed.
    TargetMeasurement seen;
    seen.T_sensor_target = e.estimator->estimate().T_chaser_target;
    seen.covariance = 1e-6 * Matrix6::Identity();
    for (const int second : {1, 2}) {
        seen.t_ns = (1 + second) * 1'000'000'000LL;
        seen.T_sensor_target.t.x += 0.1;
        EXPECT_EQ(e.estimator->take(seen).outcome, UpdateOutcome::taken) << second;
        EXPECT_NEAR(port_state(e).T_port_chaser_port.t.x, 0.1 * second, 0.005);
    }
    EXPECT_NEAR(port_state(e).velocity_m_s.x, 0.1, 0.01);
}

TEST(AttitudeTrack, InterpolatesBetweenReportsAndExtrapolatesAfterThem) {
    AttitudeTrack track;
    EXPECT_TRUE(track.empty());
    const Vec3 rate{0, 0, 0.1};
    for (int k = 0; k < 20; ++k)
        EXPECT_TRUE(track.take({0, k * 1'000'000'000LL, exp_rotation({0, 0, 0.1 * k}), rate}));
    EXPECT_FALSE(track.take({0, 19'000'000'000, {}, {}}));
    for (const double t_s : {10.0, 15.3, 18.999, 19.0, 19.7})
        EXPECT_LT(angle_between(track.at(std::llround(1e9 * t_s)).q_world_chaser, exp_rotation({0, 0, 0.1 * t_s})),
                  1e-9)
            << t_s;
}

std::vector<std::uint8_t> packet(std::int64_t number, std::int64_t epoch_unix_ns) {
    const auto unit = vlp16().configure_default();
    LidarEchoes echo;
    echo.strongest.range_m = 5;
    const std::vector<LidarEchoes> echoes(unit->spec().shots_per_packet, echo);
    std::vector<std::uint8_t> bytes(unit->spec().data_packet_bytes);
    unit->encode(number, epoch_unix_ns, echoes, bytes);
    return bytes;
}

TEST(SweepBuffer, HasTheLastTurnEvenAcrossTheHour) {
    Lidar lidar;
    lidar.model = vlp16().configure_default();
    const std::int64_t period_ns = lidar.model->spec().packet_period_ns;
    const std::size_t shots = lidar.model->spec().shots_per_packet;
    const std::int64_t epoch = 1'772'366'399'500'000'000;  // half a second before the hour
    SweepBuffer buffer(lidar, epoch);
    const std::int64_t t_ns = 1'000'000'000, last = t_ns / period_ns - 1;
    EXPECT_FALSE(buffer.complete_to(t_ns));
    for (std::int64_t p = 0; p < last; ++p) ASSERT_TRUE(buffer.take(packet(p, epoch), t_ns));
    EXPECT_FALSE(buffer.complete_to(t_ns)) << "the last one is missing";
    ASSERT_TRUE(buffer.take(packet(last, epoch), t_ns));
    EXPECT_TRUE(buffer.complete_to(t_ns));
    ASSERT_TRUE(buffer.take(packet(last + 1, epoch), t_ns));  // not over at t
    LidarSweep sweep;
    buffer.turn(t_ns, sweep);
    const std::vector<RangePoint>& points = sweep.points;
    ASSERT_FALSE(points.empty());
    EXPECT_EQ(points.size() % shots, 0u);
    EXPECT_NEAR(static_cast<double>(points.size()) / static_cast<double>(shots),
                0.1e9 / static_cast<double>(period_ns), 2);
    EXPECT_GE(points.front().t_s, -0.1);
    EXPECT_LT(points.back().t_s, 0);
    EXPECT_GT(points.back().t_s, -0.003);
}

TEST(SweepBuffer, CountsWhatIsNoPacket) {
    Lidar lidar;
    lidar.model = vlp16().configure_default();
    SweepBuffer buffer(lidar, 0);
    const std::vector<std::uint8_t> noise(lidar.model->spec().data_packet_bytes, 0x5a), empty;
    EXPECT_FALSE(buffer.take(noise, 0));
    EXPECT_FALSE(buffer.take(empty, 0));
    EXPECT_EQ(buffer.bad(), 2u);
    EXPECT_EQ(buffer.received(), 0u);
}

}  // namespace
}  // namespace narpa::rehearsal
