// The filter against simulated truth: do its errors agree with its covariance, over a hundred runs?
#include <gtest/gtest.h>

#include "tests/estimator/filter/filter_flight.h"

namespace narpa {
namespace {

using namespace test;

/// Mean over the runs is chi-square: a normal distribution to a good approximation, 95 % of it within 1.96 sigma.
double band95(double degrees_of_freedom, double samples) {
    return 1.96 * std::sqrt(2 * degrees_of_freedom / samples);
}

TEST(FilterConsistency, ErrorsAgreeWithTheCovariance) {
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
TEST(FilterConsistency, PoseOfTheFirstMeasurementIsReturned) {
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

}  // namespace
}  // namespace narpa
