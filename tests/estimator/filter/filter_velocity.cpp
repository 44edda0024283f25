// Velocities along beams: the filter expects what two rigid bodies do, and its errors agree with its covariance.
#include <gtest/gtest.h>

#include "tests/estimator/filter/filter_flight.h"

namespace narpa {
namespace {

using namespace test;

/// Where everything is in inertial axes, from the state at time 0 on: the relative state is that of a frame that
/// turns about z with the orbit's rate, the chaser is its origin.
struct Encounter {
    RelativeState state;
    double orbit_rate_rad_s;
    Quat q_world_chaser;
    Vec3 chaser_rate_rad_s;

    /// A point of the target (its axes), and one of the chaser, after t_s; without accelerations.
    [[nodiscard]] Vec3 of_target(const Vec3& point, double t_s) const {
        const Vec3 velocity = state.velocity_m_s + cross({0, 0, orbit_rate_rad_s}, state.position_m);
        return state.position_m + t_s * velocity +
               state.q_frame_target * exp_rotation(t_s * state.rate_rad_s) * point;
    }
    [[nodiscard]] Vec3 of_chaser(const Vec3& point, double t_s) const {
        return q_world_chaser * exp_rotation(t_s * chaser_rate_rad_s) * point;
    }
};

/// The beam from a point of the chaser to one of the target, with the velocity by differences of their positions.
BeamVelocity beam_between(const Encounter& s, const Vec3& on_chaser, const Vec3& on_target) {
    const Vec3 to = conjugate(s.q_world_chaser) * s.of_target(on_target, 0);
    BeamVelocity m{.origin_m = on_chaser,
                   .direction = normalized(to - on_chaser),
                   .point_m = to,
                   .sigma_m_s = 1e-9,
                   .q_frame_chaser = s.q_world_chaser,
                   .chaser_rate_rad_s = s.chaser_rate_rad_s};
    constexpr double h = 1e-4;
    const Vec3 change = (s.of_target(on_target, h) - s.of_chaser(on_chaser, h)) -
                        (s.of_target(on_target, -h) - s.of_chaser(on_chaser, -h));
    m.velocity_m_s = dot(s.q_world_chaser * m.direction, change) / (2 * h);
    return m;
}

TEST(FilterVelocity, IsThatOfTwoRigidBodies) {
    std::mt19937_64 random(5);
    for (int k = 0; k < 200; ++k) {
        const auto vector = [&](double size) {
            return size * Vec3{normal(random), normal(random), normal(random)};
        };
        Encounter s;
        s.orbit_rate_rad_s = k % 2 == 0 ? 0 : 1.13e-3;
        s.state = {vector(20), vector(0.5), exp_rotation(vector(2)), vector(0.05)};
        s.q_world_chaser = exp_rotation(vector(2));
        s.chaser_rate_rad_s = vector(0.05);
        FilterSettings settings;
        settings.motion.orbit_rate_rad_s = s.orbit_rate_rad_s;
        const Matrix12 P = 1e-14 * Matrix12::Identity();
        auto filter = *PoseFilter::create(settings, 0, s.state, P);
        const auto result = filter.update(beam_between(s, vector(3), vector(5)));
        // In units of the 1e-7 that the covariance allows a velocity: to 1e-8 m/s.
        EXPECT_EQ(result.outcome, UpdateOutcome::taken) << result.nis;
        EXPECT_LT(result.nis, 0.01);
    }
}

TEST(FilterVelocity, ErrorsAgreeWithTheCovarianceAndAreSmaller) {
    constexpr int kRuns = 100, kSteps = 20;
    constexpr double kSigma_m_s = 2e-4;
    std::uint64_t seed = 900;
    for (const Case& c : cases()) {
        SCOPED_TRACE(c.name);
        double nees = 0, nis = 0, sigma2 = 0, sigma2_without = 0;
        for (int run = 0; run < kRuns; ++run) {
            Flight r(c, ++seed);
            FilterSettings settings;
            settings.motion = c.motion;
            settings.gate = settings.beam_gate = 1e9;
            auto filter = *PoseFilter::create(settings, 0, r.first_guess(), r.first_covariance());
            auto without = filter;
            std::mt19937_64 random(seed);
            for (int k = 0; k < kSteps; ++k) {
                const auto pose = r.measure(k * kSecond);
                ASSERT_EQ(filter.update(pose).outcome, UpdateOutcome::taken);
                ASSERT_EQ(without.update(pose).outcome, UpdateOutcome::taken);
                const Encounter s{r.truth,
                                  c.motion.orbit_rate_rad_s,
                                  Flight::chaser_attitude(k * kSecond),
                                  {0.01, 0.002, -0.005}};
                for (const Vec3& point : {Vec3{1, 2, 0.5}, Vec3{-2, 0.5, 1}, Vec3{0.3, -1, -2}}) {
                    BeamVelocity m = beam_between(s, {0.4, -0.2, 1}, point);
                    m.t_ns = k * kSecond;
                    m.sigma_m_s = kSigma_m_s;
                    m.velocity_m_s += kSigma_m_s * normal(random);
                    const auto result = filter.update(m);
                    ASSERT_EQ(result.outcome, UpdateOutcome::taken) << result.why;
                    nis += result.nis / (3 * kSteps * kRuns);
                }
                r.live_on(1);
                filter.predict((k + 1) * kSecond);
                without.predict((k + 1) * kSecond);
            }
            nees += normalised_error_squared(error_between(filter.state(), r.truth), filter.covariance()) / kRuns;
            const Eigen::Vector3d along = to_eigen(normalized(r.truth.position_m));
            sigma2 += along.dot(filter.covariance().block<3, 3>(3, 3) * along);
            sigma2_without += along.dot(without.covariance().block<3, 3>(3, 3) * along);
        }
        EXPECT_NEAR(nees, 12, 3 * std::sqrt(24.0 / kRuns));
        EXPECT_NEAR(nis, 1, 3 * std::sqrt(2.0 / (3 * kSteps * kRuns)));
        EXPECT_LT(sigma2, 0.5 * sigma2_without) << "along the line of sight";
    }
}

TEST(FilterVelocity, RefusesInvalidVelocities) {
    Flight r(cases()[0], 1);
    auto filter = *PoseFilter::create({}, 0, r.first_guess(), r.first_covariance());
    const BeamVelocity good{.direction = {1, 0, 0}, .point_m = {20, 0, 0}, .sigma_m_s = 1};
    EXPECT_EQ(filter.update(good).outcome, UpdateOutcome::taken);
    const auto refused = [&](auto&& change) {
        BeamVelocity m = good;
        change(m);
        return filter.update(m).outcome;
    };
    EXPECT_EQ(refused([](auto& m) { m.direction = {1, 1, 0}; }), UpdateOutcome::bad);
    EXPECT_EQ(refused([](auto& m) { m.velocity_m_s = std::nan(""); }), UpdateOutcome::bad);
    EXPECT_EQ(refused([](auto& m) { m.sigma_m_s = 0; }), UpdateOutcome::bad);
    EXPECT_EQ(refused([](auto& m) { m.point_m.x = INFINITY; }), UpdateOutcome::bad);
    EXPECT_EQ(refused([](auto& m) { m.t_ns = -1; }), UpdateOutcome::too_late);
    EXPECT_EQ(refused([](auto& m) { m.velocity_m_s = 1e3; }), UpdateOutcome::gated);
    EXPECT_EQ(filter.counts().gated_in_a_row, 0U) << "counts poses alone";
    PoseTracker tracker({});
    EXPECT_EQ(tracker.update(good).outcome, UpdateOutcome::bad) << "cannot start a filter";
}

}  // namespace
}  // namespace narpa
