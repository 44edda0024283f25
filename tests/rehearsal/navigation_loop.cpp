// The navigation in closed loop with the dynamics, without a bus: what its sensors say is the truth and drawn
// noise.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "base/constants.h"
#include "rehearsal/dynamics/simulation.h"
#include "rehearsal/navigation/autopilot.h"
#include "tests/rehearsal/navigation_plant.h"

namespace narpa::rehearsal {
namespace {

struct Flight {
    std::vector<CycleRecord> cycles;
    std::vector<Vector6> errors;  ///< of each estimate, in its standard deviations
    std::optional<ContactEvent> contact;
    double farthest_m = 0;        ///< of the port from the target's, after an abort
    std::vector<double> axial_m;  ///< of the port along the target's axis, in each cycle of a retreat

    [[nodiscard]] const ActuatorCommand& last() const { return cycles.back().command; }
};

/// `seen(t_s)`: whether a sensor sees the target then. Its noise: 0.05 degrees, 2 cm.
template <class Seen>
Flight fly(const Scenario& s, std::uint64_t seed, const Seen& seen) {
    Simulation simulation(s, seed);
    auto autopilot = Autopilot::create(s, 1);
    EXPECT_TRUE(autopilot);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    Vector6 sigma;
    sigma << Eigen::Vector3d::Constant(0.05 * kRadPerDeg), Eigen::Vector3d::Constant(0.02);
    Flight flight;
    for (std::int64_t t_ns = 0; t_ns < 400'000'000'000; t_ns += s.period_ns()) {
        while (simulation.t_ns() < t_ns) simulation.advance_to(t_ns);
        const AttitudeReport attitude = simulation.measure_attitude();
        if (t_ns == 0) {
            EXPECT_TRUE((*autopilot)->start(0, attitude));
        }
        (*autopilot)->take(attitude);
        (*autopilot)->take(simulation.phase(), t_ns);
        const Truth truth = simulation.truth();
        const Rigid3 T_chaser_target = inverse(truth.chaser.T_world_body) * truth.target.T_world_body;
        if (seen(1e-9 * static_cast<double>(t_ns))) {
            Vector6 error;
            for (int i = 0; i < 6; ++i) error[i] = sigma[i] * normal(random);
            MeasurementResult measurement;
            measurement.pose = {t_ns, displaced(T_chaser_target, error), sigma.cwiseAbs2().asDiagonal(), {}};
            (*autopilot)->take("noise", t_ns, measurement);
        }
        flight.cycles.push_back((*autopilot)->cycle(t_ns));
        const NavigationEstimate& e = flight.cycles.back().estimate;
        Vector6 deviations;
        deviations << to_eigen(e.sigma_rotation_rad), to_eigen(e.sigma_position_m);
        flight.errors.push_back(error_between(e.T_chaser_target, T_chaser_target).cwiseQuotient(deviations));
        if (flight.last().phase == GuidancePhase::docked) break;
        if (flight.last().phase == GuidancePhase::retreating) {
            flight.farthest_m = std::max(flight.farthest_m, norm(simulation.port().position_m()));
            flight.axial_m.push_back(simulation.port().position_m().x);
        }
        simulation.apply(flight.last());
    }
    flight.contact = simulation.contact();
    return flight;
}

TEST(NavigationLoop, DocksInsideTheEnvelope) {
    const Scenario s = docking_scenario();
    for (const std::uint64_t seed : {1, 2, 3}) {
        const Flight flight = fly(s, seed, [](double) { return true; });
        ASSERT_TRUE(flight.contact) << seed;
        EXPECT_TRUE(flight.contact->captured) << seed;
        EXPECT_TRUE(within(*s.gates.contact, flight.contact->port)) << seed;
        const Vec3& p = flight.contact->port.position_m();
        EXPECT_LT(std::hypot(p.y, p.z), 0.05) << seed;
        EXPECT_EQ(flight.last().phase, GuidancePhase::docked);
        EXPECT_EQ(norm(flight.last().impulse_n_s) + norm(flight.last().angular_impulse_n_m_s), 0);
        // Errors agree with the standard deviations: mean squares of six components of correlated estimates.
        double sum = 0, worst = 0;
        for (const Vector6& e : flight.errors) {
            sum += e.squaredNorm() / 6;
            worst = std::max(worst, e.cwiseAbs().maxCoeff());
        }
        EXPECT_NEAR(sum / static_cast<double>(flight.errors.size()), 1, 0.6) << seed;
        EXPECT_LT(worst, 5) << seed;
    }
}

TEST(NavigationLoop, AbortsWithoutMeasurements) {
    const Scenario s = docking_scenario();
    const Flight flight = fly(s, 4, [](double t_s) { return t_s < 60; });
    EXPECT_EQ(flight.last().abort, AbortReason::lost);
    EXPECT_EQ(flight.last().phase, GuidancePhase::retreating);
    EXPECT_FALSE(flight.contact);
    EXPECT_GT(flight.farthest_m, 40) << "away, on what it last knew";
    for (const CycleRecord& c : flight.cycles) {
        if (c.command.abort != AbortReason::none) continue;
        ASSERT_LE(c.t_s, 80.5);
    }
}

/// Too fast for the docking system: it bounces, and goes away without touching again, knowing where it is.
TEST(NavigationLoop, RetreatsAfterABounce) {
    Scenario s = docking_scenario();
    s.legs.back().speed_m_s = 0.2;
    const Flight flight = fly(s, 7, [](double) { return true; });
    ASSERT_TRUE(flight.contact);
    EXPECT_FALSE(flight.contact->captured);
    EXPECT_EQ(flight.last().abort, AbortReason::bounced);
    ASSERT_GT(flight.axial_m.size(), 60u);
    for (std::size_t k = 3; k < 60; ++k) EXPECT_GT(flight.axial_m[k], flight.axial_m[k - 1]) << k;
    EXPECT_GT(flight.axial_m[59], 10);
    for (const Vector6& e : flight.errors) EXPECT_LT(e.cwiseAbs().maxCoeff(), 5);
}

/// A thruster that does not fire: it is off its reference, or the filter contradicts the sensor, but it does not
/// touch.
TEST(NavigationLoop, AbortsOffTheReference) {
    Scenario s = docking_scenario();
    Fault fault;
    fault.kind = fault_kind("commands_lost");
    fault.from_s = 50;
    s.faults = {fault};
    s.navigation.abort_off_m = 2;
    const Flight flight = fly(s, 5, [](double) { return true; });
    EXPECT_EQ(flight.last().abort, AbortReason::off_reference);
    EXPECT_EQ(flight.last().phase, GuidancePhase::retreating);
}

TEST(NavigationLoop, TheSameSeedGivesTheSameCommands) {
    Scenario s = docking_scenario();
    s.duration_s = 60;
    const auto until_60_s = [](double t_s) { return t_s < 20; };
    const Flight one = fly(s, 6, until_60_s), other = fly(s, 6, until_60_s);
    ASSERT_EQ(one.cycles.size(), other.cycles.size());
    for (std::size_t i = 0; i < one.cycles.size(); ++i) {
        EXPECT_EQ(one.cycles[i].command.impulse_n_s, other.cycles[i].command.impulse_n_s);
        EXPECT_EQ(one.cycles[i].estimate.T_chaser_target, other.cycles[i].estimate.T_chaser_target);
    }
}

}  // namespace
}  // namespace narpa::rehearsal
