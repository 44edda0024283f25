// One docking geometry: at every limit of the capture envelope the dynamics and the judge decide alike, one unit in
// the last place inside and outside, and the navigation computes the same port state.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "base/constants.h"
#include "rehearsal/navigation/estimation/relative_motion.h"
#include "tests/rehearsal/dynamics_support.h"
#include "tests/rehearsal/judge_support.h"

namespace narpa::rehearsal {
namespace {

/// Oblique axes, moments and offsets; meets the port within the standard's envelope, with every quantity above
/// zero.
Scenario oblique() {
    Scenario s = quiet();
    s.legs.resize(1);
    s.legs[0].contact = true;
    s.q_world_target = normalized(Quat{1, 2, 3, 4});
    s.target.T_body_port.q = normalized(Quat{1, 0.2, 1, -0.3});
    s.chaser.T_body_port.q = normalized(Quat{1, 1, 0.1, 0.4});
    s.target_motion.rate_deg_s = {0.1, 0.2, 0.3};
    s.start.position_m = {0.5, 0.03, -0.02};
    s.start.velocity_m_s = {-0.07, 0.005, 0.004};
    s.start.attitude_deg = {1, 0.5, -0.7};
    s.start.rate_deg_s = {0.03, 0.02, 0.04};
    return s;
}

Simulation at_contact(const Scenario& scenario) {
    Simulation simulation = simulate(scenario);
    simulation.advance_to(ns(100));
    return simulation;
}

/// What the judge makes of the messages that the dynamics send at contact.
Verdict judged(const Scenario& scenario, const Simulation& simulation) {
    Messages m(scenario);
    const double t_s = 1e-9 * static_cast<double>(simulation.t_ns());
    const Truth truth = simulation.truth();
    m.report(t_s, simulation.phase());
    m.poses(t_s, truth.chaser, truth.target);
    m.report(t_s + 1, DynamicsPhase::finished);
    return judge(scenario, m);
}

/// The limits of an envelope in the order of its conditions; the closing rate has two.
std::array<double*, 8> limits_of(CaptureEnvelope& e) {
    return {&e.closing_min_m_s, &e.closing_max_m_s, &e.lateral_rate_m_s,     &e.lateral_m,
            &e.pitch_yaw_deg,   &e.roll_deg,        &e.pitch_yaw_rate_deg_s, &e.roll_rate_deg_s};
}

TEST(DockingGeometry, DynamicsAndJudgeAgreeAtEveryLimit) {
    Scenario scenario = oblique();
    scenario.gates.contact = CaptureEnvelope{};
    const Verdict first = judged(scenario, at_contact(scenario));
    ASSERT_TRUE(first.contact);
    std::array<double, 8> values{first.contact->conditions[0].value};
    for (std::size_t i = 0; i < 7; ++i) values[i + 1] = first.contact->conditions[i].value;

    for (std::size_t limit = 0; limit < values.size(); ++limit) {
        EXPECT_GT(values[limit], 0);
        const double outwards = limit == 0 ? -kInfinity : kInfinity;
        for (const int ulp : {-1, 0, 1}) {  // the limit is so far outside the value
            double at = values[limit];
            if (ulp != 0) at = std::nextafter(at, ulp * outwards);
            scenario.gates.contact = CaptureEnvelope{};
            *limits_of(*scenario.gates.contact)[limit] = at;
            const Simulation simulation = at_contact(scenario);
            const Verdict v = judged(scenario, simulation);
            ASSERT_TRUE(v.contact);
            const GateState expected = ulp >= 0 ? GateState::passed : GateState::failed;
            EXPECT_EQ(simulation.contact()->captured, ulp >= 0) << limit << " " << ulp;
            EXPECT_EQ(gate(v, "contact").state, expected) << limit << " " << gate(v, "contact").reason;
            EXPECT_EQ(within(*scenario.gates.contact, v.contact->state), ulp >= 0) << limit << " " << ulp;
        }
    }
}

TEST(DockingGeometry, NavigationComputesThePortStateOfTheDynamics) {
    const Scenario s = oblique();
    const Simulation simulation = at_contact(s);
    const Truth truth = simulation.truth();
    const Motion target = fixed_to(truth.target, {{}, s.target.centre_of_mass_m});
    const Motion chaser = fixed_to(truth.chaser, {{}, s.chaser.centre_of_mass_m});
    const RelativeMotion motion{chaser.T_world_body.t, chaser.velocity_m_s, target.T_world_body.q,
                                chaser.T_world_body.q, target.rate_rad_s,   chaser.rate_rad_s};
    const PortState a = port_state(motion, s.target, s.chaser), b = simulation.port();
    expect_near(a.position_m(), b.position_m(), 1e-12);
    expect_near(a.velocity_m_s, b.velocity_m_s, 1e-14);
    expect_near(a.misalignment_rad(), b.misalignment_rad(), 1e-13);
    expect_near(a.rate_rad_s, b.rate_rad_s, 1e-15);
}

/// Where the centres of mass, the bodies' origins and the ports coincide, no arithmetic differs: equal to the last
/// bit.
TEST(DockingGeometry, NavigationAgreesToTheLastBitAtTheLimits) {
    Vehicle vehicle;
    const CaptureEnvelope e;
    for (const double y : {e.lateral_m, std::nextafter(e.lateral_m, 0), std::nextafter(e.lateral_m, 1)})
        for (const double x :
             {e.closing_max_m_s, std::nextafter(e.closing_max_m_s, 0), std::nextafter(e.closing_max_m_s, 1)}) {
            const RelativeMotion motion{{0, y, 0}, {-x, 0, 0}, {}, T_port_docked().q, {}, {}};
            const PortState of_navigation = port_state(motion, vehicle, vehicle);
            const PortState of_bodies =
                port_state(vehicle, Motion{}, vehicle, {{T_port_docked().q, {0, y, 0}}, {-x, 0, 0}, {}});
            EXPECT_EQ(of_navigation.lateral_m(), y);
            EXPECT_EQ(of_bodies.lateral_m(), y);
            EXPECT_EQ(of_navigation.closing_m_s(), x);
            EXPECT_EQ(within(e, of_navigation), y <= e.lateral_m && x <= e.closing_max_m_s);
            EXPECT_EQ(within(e, of_bodies), within(e, of_navigation));
        }
}

TEST(DockingGeometry, AMotionIsRecoveredFromItsPortState) {
    const Scenario s = oblique();
    const Truth truth = at_contact(s).truth();
    const PortState state = port_state(s.target, truth.target, s.chaser, truth.chaser);
    const Motion again = chaser_motion(state, s.target, truth.target, s.chaser);
    expect_near(again.T_world_body.t, truth.chaser.T_world_body.t, 1e-13);
    EXPECT_LT(angle_between(again.T_world_body.q, truth.chaser.T_world_body.q), 1e-14);
    expect_near(again.velocity_m_s, truth.chaser.velocity_m_s, 1e-15);
    expect_near(again.rate_rad_s, truth.chaser.rate_rad_s, 1e-16);
}

}  // namespace
}  // namespace narpa::rehearsal
