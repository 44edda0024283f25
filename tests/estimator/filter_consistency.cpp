// The filter against simulated truth: are its errors what its covariance says, over a hundred runs?
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "../support/allocation_counter.h"
#include "../support/shapes.h"
#include "estimator/filter/pose_filter.h"

namespace narpa {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
constexpr double kPi = 3.14159265358979323846;

double normal(std::mt19937_64& random) {
    return std::normal_distribution<double>()(random);
}
template <int N>
Eigen::Matrix<double, N, 1> draw(const Eigen::Matrix<double, N, N>& covariance, std::mt19937_64& random) {
    Eigen::Matrix<double, N, 1> white;
    for (int i = 0; i < N; ++i) white[i] = normal(random);
    return Eigen::LLT<Eigen::Matrix<double, N, N>>(covariance).matrixL() * white;
}

/// A camera knows range ten times less well than direction, and tilt goes with sideways.
Matrix6 camera_like() {
    Matrix6 L = Matrix6::Zero();
    L.diagonal() << 8e-3, 8e-3, 3e-3, 4e-3, 4e-3, 6e-2;
    L(3, 1) = 3e-3;
    L(4, 0) = -3e-3;
    return L * L.transpose();
}
Matrix6 lidar_like() {
    Matrix6 L = Matrix6::Zero();
    L.diagonal() << 5e-4, 7e-4, 1e-3, 2e-3, 1e-3, 1.5e-3;
    L(5, 0) = 8e-4;
    return L * L.transpose();
}

/// Moves the truth on by its own small steps: Euler and impulses, nothing of the filter's.
void live(const MotionModel& model, double dt_s, RelativeState& s, std::mt19937_64& random) {
    constexpr int kSteps = 20;
    const double h = dt_s / kSteps, n = model.orbit_rate_rad_s;
    const auto kick = [&](double psd) {
        return std::sqrt(psd * h) * Vec3{normal(random), normal(random), normal(random)};
    };
    const auto euler = [&](const Vec3& w) {
        if (!model.inertia_kg_m2) return Vec3{};
        const Vec3 momentum = to_vec3(*model.inertia_kg_m2 * to_eigen(w));
        return to_vec3(model.inertia_kg_m2->ldlt().solve(to_eigen(cross(momentum, w))));
    };
    for (int i = 0; i < kSteps; ++i) {
        const auto gravity = [&](const Vec3& r, const Vec3& v) {
            return Vec3{3 * n * n * r.x + 2 * n * v.y, -2 * n * v.x, -n * n * r.z};
        };
        const Vec3 v_middle = s.velocity_m_s + 0.5 * h * gravity(s.position_m, s.velocity_m_s);
        const Vec3 r_middle = s.position_m + 0.5 * h * s.velocity_m_s;
        const Vec3 jolt = kick(model.acceleration_psd);
        s.position_m += h * (v_middle + 0.5 * jolt);
        s.velocity_m_s += h * gravity(r_middle, v_middle) + jolt;
        const Vec3 twist = kick(model.angular_acceleration_psd);
        const Vec3 w_middle = s.rate_rad_s + 0.5 * h * euler(s.rate_rad_s);
        s.q_frame_target = normalized(exp_rotation({0, 0, -n * h}) * s.q_frame_target *
                                      exp_rotation(h * (w_middle + 0.5 * twist)));
        s.rate_rad_s += h * euler(w_middle) + twist;
    }
}

struct Case {
    const char* name;
    MotionModel motion;
    Matrix6 sensor;
};
std::vector<Case> cases() {
    MotionModel free, orbit, rigid;
    free.acceleration_psd = orbit.acceleration_psd = rigid.acceleration_psd = 1e-8;
    free.angular_acceleration_psd = orbit.angular_acceleration_psd = rigid.angular_acceleration_psd = 1e-10;
    orbit.orbit_rate_rad_s = 1.13e-3;
    rigid.inertia_kg_m2 = Eigen::Vector3d(900, 600, 350).asDiagonal();
    MotionModel both = rigid;
    both.orbit_rate_rad_s = orbit.orbit_rate_rad_s;
    return {{"free, camera", free, camera_like()},
            {"free, lidar", free, lidar_like()},
            {"orbit, camera", orbit, camera_like()},
            {"orbit, lidar", orbit, lidar_like()},
            {"tumbling, camera", rigid, camera_like()},
            {"tumbling, lidar", rigid, lidar_like()},
            {"orbit, tumbling, camera", both, camera_like()},
            {"orbit, tumbling, lidar", both, lidar_like()}};
}

/// One run: truth, chaser, sensor.
class Flight {
public:
    Flight(const Case& c, std::uint64_t seed) : case_(c), random_(seed) {
        P0_.setZero();
        P0_.diagonal() << 0.04, 0.04, 0.04, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6;
        truth.position_m = {1.0, 30.0, -2.0};
        truth.velocity_m_s = {0.02, -0.3, 0.01};
        truth.rate_rad_s = {0.03, -0.02, 0.01};
        // The attitude begins half a turn from the sensor's, and keeps going through it.
        const Vec3 axis = test::random_direction(random_);
        truth.q_frame_target = normalized(sensor_attitude(0) * exp_rotation(kPi * axis));
    }
    [[nodiscard]] RelativeState first_guess() { return displaced(truth, -draw<12>(P0_, random_)); }
    [[nodiscard]] const Matrix12& first_covariance() const { return P0_; }

    [[nodiscard]] PoseMeasurement measure(std::int64_t t_ns) {
        PoseMeasurement m;
        m.t_ns = t_ns;
        m.covariance = case_.sensor;
        m.T_chaser_sensor = mount_;
        m.q_frame_chaser = chaser_attitude(t_ns);
        const Quat inertial = conjugate(m.q_frame_chaser);
        const Rigid3 T = inverse(mount_) * Rigid3{inertial * truth.q_frame_target, inertial * truth.position_m};
        m.T_sensor_target = displaced(T, draw<6>(case_.sensor, random_));
        if (random_() % 2 != 0) m.T_sensor_target.q = -m.T_sensor_target.q;
        return m;
    }
    void live_on(double dt_s) { live(case_.motion, dt_s, truth, random_); }

    RelativeState truth;

    [[nodiscard]] static Quat chaser_attitude(std::int64_t t_ns) {
        return exp_rotation(1e-9 * static_cast<double>(t_ns) * Vec3{0.01, 0.002, -0.005}) *
               normalized(Quat{0.5, 0.1, -0.7, 0.4});
    }

private:
    [[nodiscard]] Quat sensor_attitude(std::int64_t t_ns) const { return chaser_attitude(t_ns) * mount_.q; }

    const Case& case_;
    std::mt19937_64 random_;
    Matrix12 P0_;
    Rigid3 mount_{normalized(Quat{0.9, -0.2, 0.3, 0.1}), {0.4, -0.2, 1.0}};
};

/// Mean over the runs is chi-square: a normal distribution to a good approximation, 95 % of it within 1.96 sigma.
double band95(double degrees_of_freedom, double samples) {
    return 1.96 * std::sqrt(2 * degrees_of_freedom / samples);
}

TEST(FilterConsistency, ErrorsAreWhatTheCovarianceSays) {
    constexpr int kRuns = 100, kSteps = 40;
    std::uint64_t seed = 0;
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        std::vector<double> nees(kSteps, 0.0);
        double nis = 0;
        UpdateCounts counts;
        for (int run = 0; run < kRuns; ++run) {
            Flight r(c, ++seed);
            FilterSettings settings;
            settings.motion = c.motion;
            settings.gate = 1e9;
            auto filter = *PoseFilter::create(settings, 0, r.first_guess(), r.first_covariance());
            for (int k = 0; k < kSteps; ++k) {
                const UpdateResult u = filter.update(r.measure(k * kSecond));
                ASSERT_EQ(u.outcome, UpdateOutcome::taken) << u.why;
                nis += u.nis;
                nees[static_cast<std::size_t>(k)] +=
                    normalised_error_squared(error_between(filter.state(), r.truth), filter.covariance());
                r.live_on(1);
            }
            counts = filter.counts();
        }
        int inside = 0;
        double mean = 0;
        for (const double sum : nees) {
            inside += std::abs(sum / kRuns - 12) < band95(12, kRuns);
            mean += sum / kRuns / kSteps;
        }
        EXPECT_NEAR(mean, 12, band95(12, kRuns)) << "the band of one time: times are not independent";
        // 95 % of the times are expected inside; neighbours go together, a quarter of them count.
        EXPECT_GE(inside, 0.95 * kSteps - 3 * std::sqrt(0.95 * 0.05 * kSteps * 4));
        // Innovations of a right filter are independent.
        EXPECT_NEAR(nis / (kRuns * kSteps), 6, 2 * band95(6, kRuns * kSteps));
        EXPECT_EQ(counts.taken, static_cast<std::uint64_t>(kSteps));
    }
}

/// The pose that comes out has the convention of those that went in.
TEST(FilterConsistency, PosesComeOutAsTheyWentIn) {
    const Case c = cases()[2];
    Flight r(c, 3);
    const PoseMeasurement m = r.measure(0);
    const auto filter = PoseFilter::create({c.motion}, m, 1, 0.1);
    ASSERT_TRUE(filter) << filter.error().text();
    const auto out = filter->pose(m.q_frame_chaser);
    EXPECT_LT(error_between(out.T_chaser_target, m.T_chaser_sensor * m.T_sensor_target).norm(), 1e-9);
    // The same, out of its mounting: what the chaser's axes make of the sensor's.
    PoseMeasurement unmounted = m;
    unmounted.T_sensor_target = m.T_chaser_sensor * m.T_sensor_target;
    unmounted.T_chaser_sensor = {};
    Matrix6 turn = Matrix6::Zero();
    const auto columns_of = columns(m.T_chaser_sensor.q);
    for (int i = 0; i < 3; ++i) {
        turn.block<3, 1>(0, i) = to_eigen(columns_of[static_cast<std::size_t>(i)]);
        turn.block<3, 1>(3, 3 + i) = to_eigen(columns_of[static_cast<std::size_t>(i)]);
    }
    unmounted.covariance = turn * m.covariance * turn.transpose();
    EXPECT_LT((out.covariance - unmounted.covariance).norm(), 1e-12 * out.covariance.norm());
    EXPECT_NEAR(filter->covariance()(4, 4), 1, 1e-12);
    EXPECT_NEAR(filter->covariance()(9, 9), 0.01, 1e-14);
    EXPECT_NEAR(norm(filter->state().rate_rad_s), c.motion.orbit_rate_rad_s, 1e-15);
}

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
        if (t == 3) filter.accelerate({0.001, 0, -0.002});
        if (t == 9) filter.accelerate({});
        for (; next < order.size() && order[next] <= t; ++next)
            EXPECT_EQ(filter.update(measurements[static_cast<std::size_t>(order[next])]).outcome,
                      UpdateOutcome::taken);
    }
    return {filter.state(), filter.covariance(), filter.counts()};
}

TEST(FilterHistory, LateMeasurementsAreWorthAsMuch) {
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

TEST(FilterHistory, WhatIsOlderThanItIsCounted) {
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

TEST(FilterUpdate, RefusesWhatIsNoMeasurement) {
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
    EXPECT_FALSE(filter.accelerate({kNan, 0, 0}));
    EXPECT_FALSE(filter.accelerate({}, -1));
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

TEST(FilterUpdate, ThrustIsAsUnsureAsItIsSaidToBe) {
    const Case c = cases()[1];
    Flight r(c, 10);
    const Matrix12 P = r.first_covariance();
    auto filter = *PoseFilter::create({c.motion}, 0, r.truth, P);
    ASSERT_TRUE(filter.accelerate({0.01, 0, 0}, 3e-4));
    filter.predict(2 * kSecond);
    ASSERT_TRUE(filter.accelerate({}));
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
            filter.accelerate({1e-4 * k, 0, 0});
            filter.update(r.measure(k * kSecond / 10));
            r.live_on(0.1);
        }
        EXPECT_EQ(heap.on_this_thread(), 0u);
        EXPECT_EQ(filter.counts().late, filter.counts().taken);
    }
}

}  // namespace
}  // namespace narpa
