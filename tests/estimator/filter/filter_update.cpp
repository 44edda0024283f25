// What the filter does with measurements that are late, wrong, bad or very good, and with thrust.
#include <gtest/gtest.h>

#include "tests/estimator/filter/filter_flight.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

using namespace test;

struct Ended {
    RelativeState state;
    Matrix12 covariance;
    UpdateCounts counts;
};
/// Twenty measurements in this order, the chaser's thrusters at work now and then; the filter at 21 s.
Ended in_order(const Case& c, const std::vector<PoseMeasurement>& measurements, const std::vector<int>& order,
               const Flight& r, const RelativeState& guess) {
    auto filter = *PoseFilter::create({c.motion}, 0, guess, r.first_covariance());
    std::size_t next = 0;
    for (int t = 0; t <= 21; ++t) {
        filter.predict(t * kSecond);
        if (t == 3) filter.accelerate(t * kSecond, {0.001, 0, -0.002});
        if (t == 9) filter.accelerate(t * kSecond, {});
        for (; next < order.size() && order[next] <= t; ++next)
            EXPECT_EQ(filter.update(measurements[static_cast<std::size_t>(order[next])]).outcome,
                      UpdateOutcome::taken);
    }
    return {filter.state(), filter.covariance(), filter.counts()};
}

TEST(FilterHistory, LateMeasurementsGiveTheSameEstimate) {
    for (const Case& c : {cases()[3], cases()[5]}) {
        SCOPED_TRACE(c.name);
        Flight r(c, 21);
        const RelativeState guess = r.first_guess();
        std::vector<PoseMeasurement> measurements;
        std::vector<int> punctual, late;
        for (int k = 0; k < 20; ++k) {
            measurements.push_back(r.measure(k * kSecond));
            r.live_on(1);
            if (k >= 3 && k < 9) r.truth.velocity_m_s += Vec3{0.001, 0, -0.002};
            punctual.push_back(k);
            late.push_back(k / 5 * 5 + 4 - k % 5);  // 4 3 2 1 0 9 8 7 6 5 ...
        }
        const Ended a = in_order(c, measurements, punctual, r, guess);
        const Ended b = in_order(c, measurements, late, r, guess);
        EXPECT_EQ(a.counts.late, 0u);
        EXPECT_GT(b.counts.late, 10u);
        EXPECT_EQ(b.counts.taken, 20u);
        EXPECT_LT((a.covariance - b.covariance).norm(), 1e-6 * a.covariance.norm());
        const Vector12 apart = error_between(a.state, b.state);
        EXPECT_LT(normalised_error_squared(apart, a.covariance), 1e-8) << apart.transpose();
    }
}

/// Thrust that becomes known after measurements of a later time, and once after a thrust that it replaces.
TEST(FilterHistory, LateThrustGivesTheSameEstimate) {
    const Case c = cases()[3];
    Flight r(c, 22);
    const RelativeState guess = r.first_guess();
    auto punctual = *PoseFilter::create({c.motion}, 0, guess, r.first_covariance()), late = punctual;
    const Vec3 thrust{0.001, 0, -0.002};
    for (int k = 0; k < 20; ++k) {
        if (k == 4) punctual.accelerate(7 * kSecond / 2, thrust, 1e-6);
        if (k == 10) punctual.accelerate(37 * kSecond / 4, {});
        const PoseMeasurement m = r.measure(k * kSecond);
        EXPECT_EQ(punctual.update(m).outcome, UpdateOutcome::taken);
        EXPECT_EQ(late.update(m).outcome, UpdateOutcome::taken);
        if (k == 4) late.accelerate(4 * kSecond, {1, 2, 3});
        if (k == 4) late.accelerate(7 * kSecond / 2, thrust, 1e-6);
        if (k == 11) late.accelerate(37 * kSecond / 4, {});
        r.live_on(1);
        if (k >= 3 && k < 9) r.truth.velocity_m_s += (k == 3 ? 0.5 : 1) * thrust;
        if (k == 9) r.truth.velocity_m_s += 0.25 * thrust;
    }
    EXPECT_EQ(punctual.t_ns(), late.t_ns());
    EXPECT_LT((punctual.covariance() - late.covariance()).norm(), 1e-9 * punctual.covariance().norm());
    const Vector12 apart = error_between(punctual.state(), late.state());
    EXPECT_LT(normalised_error_squared(apart, punctual.covariance()), 1e-12) << apart.transpose();
}

TEST(FilterHistory, OlderMeasurementsAreCounted) {
    const Case c = cases()[1];
    Flight r(c, 5);
    FilterSettings settings{c.motion};
    settings.history = 4;
    auto filter = *PoseFilter::create(settings, 0, r.first_guess(), r.first_covariance());
    std::vector<PoseMeasurement> measurements;
    for (int k = 0; k < 10; ++k) {
        measurements.push_back(r.measure(k * kSecond));
        r.live_on(1);
    }
    for (int k = 0; k < 10; k += 2)
        EXPECT_EQ(filter.update(measurements[static_cast<std::size_t>(k)]).outcome, UpdateOutcome::taken);
    const RelativeState before = filter.state();
    EXPECT_EQ(filter.update(measurements[1]).outcome, UpdateOutcome::too_late);
    EXPECT_EQ(before, filter.state());
    EXPECT_EQ(filter.counts().too_late, 1u);
    EXPECT_EQ(filter.update(measurements[3]).outcome, UpdateOutcome::taken);
    EXPECT_EQ(filter.update(measurements[7]).outcome, UpdateOutcome::taken);
    EXPECT_EQ(filter.counts().late, 2u);
    EXPECT_NE(before, filter.state());
    EXPECT_EQ(filter.t_ns(), 8 * kSecond);
}

TEST(FilterUpdate, AContradictionIsGatedAndCounted) {
    const Case c = cases()[1];
    Flight r(c, 6);
    auto filter = *PoseFilter::create({c.motion}, 0, r.first_guess(), r.first_covariance());
    EXPECT_EQ(filter.update(r.measure(0)).outcome, UpdateOutcome::taken);
    const RelativeState before = filter.state();
    PoseMeasurement wrong = r.measure(0);
    wrong.T_sensor_target.t += Vec3{0, 0, 0.5};
    for (int k = 1; k <= 3; ++k) {
        const UpdateResult u = filter.update(wrong);
        EXPECT_EQ(u.outcome, UpdateOutcome::gated);
        EXPECT_GT(u.nis, 1000);
        EXPECT_EQ(filter.counts().gated_in_a_row, static_cast<std::uint64_t>(k));
    }
    EXPECT_EQ(before, filter.state());
    EXPECT_EQ(filter.update(r.measure(0)).outcome, UpdateOutcome::taken);
    EXPECT_EQ(filter.counts().gated_in_a_row, 0u);
    EXPECT_EQ(filter.counts().gated, 3u);
}

/// Of right measurements a ten-thousandth is gated: 0.5 of these, and with 1 % as the gate 50.
TEST(FilterUpdate, TheGateHasItsProbability) {
    const Case c = cases()[0];
    FilterSettings settings{c.motion};
    settings.gate = 16.81;  // 0.99 of chi-square with six degrees of freedom
    std::uint64_t gated = 0;
    for (std::uint64_t run = 0; run < 50; ++run) {
        Flight r(c, 500 + run);
        auto filter = *PoseFilter::create(settings, 0, r.first_guess(), r.first_covariance());
        for (int k = 0; k < 100; ++k) {
            filter.update(r.measure(k * kSecond / 4));
            r.live_on(0.25);
        }
        gated += filter.counts().gated;
    }
    EXPECT_NEAR(static_cast<double>(gated), 50, 4 * std::sqrt(50.0));
}

TEST(FilterUpdate, RefusesInvalidMeasurements) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    const Case c = cases()[1];
    Flight r(c, 7);
    auto filter = *PoseFilter::create({c.motion}, 0, r.first_guess(), r.first_covariance());
    const PoseMeasurement good = r.measure(0);
    const RelativeState before = filter.state();
    std::uint64_t bad = 0;
    for (const auto change : {+[](PoseMeasurement& m) { m.covariance(2, 2) = -1e-6; },
                              +[](PoseMeasurement& m) { m.covariance.setZero(); },
                              +[](PoseMeasurement& m) { m.covariance(1, 1) = kNan; },
                              +[](PoseMeasurement& m) { m.covariance(0, 1) += 1e-7; },
                              +[](PoseMeasurement& m) { m.T_sensor_target.t.x = kNan; },
                              +[](PoseMeasurement& m) {
                                  m.T_sensor_target.q = {2, 0, 0, 0};
                              },
                              +[](PoseMeasurement& m) {
                                  m.T_chaser_sensor.q = {kNan, 0, 0, 0};
                              },
                              +[](PoseMeasurement& m) {
                                  m.q_frame_chaser = {0, 0, 0, 0};
                              }}) {
        PoseMeasurement m = good;
        change(m);
        const UpdateResult u = filter.update(m);
        EXPECT_EQ(u.outcome, UpdateOutcome::bad);
        EXPECT_NE(std::string(u.why).find("expected"), std::string::npos);
        EXPECT_EQ(filter.counts().bad, ++bad);
        EXPECT_FALSE(PoseFilter::create({c.motion}, m, 1, 1));
    }
    EXPECT_FALSE(filter.accelerate(0, {kNan, 0, 0}));
    EXPECT_FALSE(filter.accelerate(0, {}, -1));
    EXPECT_FALSE(filter.accelerate(-1, {}));
    EXPECT_EQ(before, filter.state());
    EXPECT_EQ(filter.update(good).outcome, UpdateOutcome::taken);

    EXPECT_FALSE(PoseFilter::create({c.motion}, 0, before, -r.first_covariance()));
    EXPECT_FALSE(PoseFilter::create({c.motion}, 0, {{kNan, 0, 0}, {}, {}, {}}, r.first_covariance()));
    EXPECT_FALSE(PoseFilter::create({c.motion}, good, 0, 1));
    FilterSettings settings{c.motion};
    settings.history = 1;
    EXPECT_FALSE(PoseFilter::create(settings, 0, before, r.first_covariance()));
    settings = {c.motion, kNan};
    EXPECT_FALSE(PoseFilter::create(settings, 0, before, r.first_covariance()));
}

TEST(FilterUpdate, ThrustNoiseAddsToTheCovariance) {
    const Case c = cases()[1];
    Flight r(c, 10);
    const Matrix12 P = r.first_covariance();
    auto filter = *PoseFilter::create({c.motion}, 0, r.truth, P);
    ASSERT_TRUE(filter.accelerate(0, {0.01, 0, 0}, 3e-4));
    filter.predict(2 * kSecond);
    ASSERT_TRUE(filter.accelerate(2 * kSecond, {}));
    filter.predict(5 * kSecond);
    EXPECT_NEAR(filter.state().velocity_m_s.x, r.truth.velocity_m_s.x + 0.02, 1e-12);
    EXPECT_NEAR(filter.covariance()(3, 3), P(3, 3) + 2 * 3e-4 + 5 * c.motion.acceleration_psd, 1e-12);
}

/// A poor first guess, then many precise measurements: the covariance stays positive definite, and small.
TEST(FilterUpdate, StaysPositiveDefinite) {
    const Case c = cases()[7];
    Flight r(c, 8);
    auto filter = *PoseFilter::create({c.motion, 1e9}, 0, r.first_guess(), 1e6 * r.first_covariance());
    for (int k = 0; k < 300; ++k) {
        PoseMeasurement m = r.measure(k * kSecond / 20);
        m.covariance *= 1e-6;
        m.T_sensor_target = r.measure(k * kSecond / 20).T_sensor_target;
        filter.update(m);
        ASSERT_EQ(Eigen::LLT<Matrix12>(filter.covariance()).info(), Eigen::Success) << k;
        r.live_on(0.05);
    }
    EXPECT_EQ(filter.covariance(), Matrix12(filter.covariance().transpose()));
}

TEST(FilterUpdate, NeedsNoHeap) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer's heap is not counted";
    for (const Case& c : {cases()[0], cases()[7]}) {
        Flight r(c, 9);
        FilterSettings settings{c.motion};
        settings.history = 8;
        auto filter = *PoseFilter::create(settings, 0, r.first_guess(), r.first_covariance());
        const test::AllocationCounter heap;
        for (int k = 0; k < 40; ++k) {
            filter.predict((k + 2) * kSecond / 10);
            filter.accelerate((k + 2) * kSecond / 10, {1e-4 * k, 0, 0});
            filter.update(r.measure(k * kSecond / 10));
            r.live_on(0.1);
        }
        EXPECT_EQ(heap.on_this_thread(), 0u);
        EXPECT_EQ(filter.counts().late, filter.counts().taken);
    }
}

/// A lander at 35 m/s: its second pose contradicts a filter that takes its velocity for about 1 m/s.
TEST(PoseTracker, FollowsATargetThatIsFasterThanItsFirstVelocity) {
    for (const double speed_m_s : {0.5, 7.0, 35.0, 300.0}) {
        PoseTracker tracker({});
        Matrix6 covariance = Matrix6::Identity() * 1e-6;
        covariance.bottomRightCorner<3, 3>() *= 1e2;
        for (int k = 0; k < 10; ++k) {
            const double t_s = 0.5 * k;
            const UpdateResult result =
                tracker.update(PoseMeasurement{.t_ns = k * 500'000'000LL,
                                               .T_sensor_target = {{}, {1, 2, 800 - speed_m_s * t_s}},
                                               .covariance = covariance});
            EXPECT_EQ(result.outcome, UpdateOutcome::taken) << speed_m_s << " m/s, " << k << ": " << result.why;
        }
        EXPECT_LE(tracker.restarts(), 1u) << speed_m_s;
        EXPECT_NEAR(tracker.filter().state().velocity_m_s.z, -speed_m_s, 0.1) << speed_m_s;
    }
}

}  // namespace
}  // namespace narpa
