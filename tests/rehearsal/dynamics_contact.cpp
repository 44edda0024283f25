// How a run begins, how the ports meet, and how it ends.

#include "base/constants.h"
#include "tests/rehearsal/dynamics_support.h"

namespace narpa::rehearsal {
namespace {

Scenario closing(double speed_m_s) {
    Scenario s = quiet();
    s.start.position_m = {0.5, 0, 0};
    s.start.velocity_m_s = {-speed_m_s, 0, 0};
    return s;
}

TEST(Contact, HappensInTheNanosecondThatReachesThePortsPlane) {
    const Scenario scenario = closing(0.07);
    Simulation s = simulate(scenario);
    s.advance_to(ns(100));
    EXPECT_NEAR(static_cast<double>(s.t_ns()), 0.5 / 0.07 * 1e9, 2);
    ASSERT_TRUE(s.contact());
    EXPECT_EQ(s.contact()->t_ns, s.t_ns());
    EXPECT_EQ(s.phase(), DynamicsPhase::captured);
    expect_near(s.port().position_m(), {}, 1e-9);
    expect_near(s.port().velocity_m_s, {-0.07, 0, 0}, 1e-12);  // as it was before they touched
}

TEST(Contact, IsBeforeTheRequestedTime) {
    Simulation first = simulate(closing(0.07));
    first.advance_to(ns(100));
    Simulation s = simulate(closing(0.07));
    s.advance_to(first.t_ns());  // there at this very time
    EXPECT_EQ(s.t_ns(), first.t_ns() - 1);
    EXPECT_EQ(s.phase(), DynamicsPhase::captured);
    s.advance_to(first.t_ns());
    EXPECT_EQ(s.t_ns(), first.t_ns());
}

TEST(Contact, InsideTheEnvelopeTheChaserIsHeldAndMovesWithTheTarget) {
    Scenario scenario = closing(0.07);
    scenario.target_motion.rate_deg_s = {0.5, 1, -2};
    scenario.start.attitude_deg = {1, 2, -1};
    scenario.start.position_m = {0.02, 0.05, 0};
    Simulation s = simulate(scenario);
    s.advance_to(ns(100));
    ASSERT_EQ(s.phase(), DynamicsPhase::captured);
    const PortState met = s.contact()->port;
    s.apply({0, s.t_ns(), {400, 400, 400}, {400, 0, 0}});
    s.advance_to(s.t_ns() + ns(1.5));
    EXPECT_EQ(s.ending(), Ending::not_yet);
    s.advance_to(s.t_ns() + ns(0.5));
    EXPECT_EQ(s.ending(), Ending::captured);
    expect_near(s.port().position_m(), met.position_m(), 1e-12);
    expect_near(s.port().misalignment_rad(), met.misalignment_rad(), 1e-12);
    expect_near(s.port().velocity_m_s, {}, 1e-12);
    expect_near(s.port().rate_rad_s, {}, 1e-12);
}

TEST(Contact, OutsideTheEnvelopeItReboundsAtThreeTenthsOfTheSpeed) {
    Scenario scenario = closing(0.2);
    scenario.start.position_m.z = 0.03;
    scenario.start.velocity_m_s.z = 0.01;
    Simulation s = simulate(scenario);
    s.advance_to(ns(100));
    EXPECT_EQ(s.phase(), DynamicsPhase::bounced);
    EXPECT_FALSE(s.contact()->captured);
    const std::int64_t contact_ns = s.t_ns();
    s.advance_to(contact_ns + ns(9.5));
    EXPECT_EQ(s.ending(), Ending::not_yet);
    expect_near(s.port().velocity_m_s, {0.06, 0, 0.01}, 1e-12);
    EXPECT_NEAR(s.port().position_m().x, 0.06 * 9.5, 1e-8);
    s.advance_to(contact_ns + ns(10));
    EXPECT_EQ(s.ending(), Ending::bounced);
}

TEST(Contact, ThrustAfterABounceDoesNotPenetrateThePort) {
    Scenario scenario = closing(0.2);
    scenario.faults.push_back({fault_kind("thruster_stuck"), 0, 1000, "+fx", {}});
    Simulation s = simulate(scenario);
    s.advance_to(ns(100));
    ASSERT_EQ(s.phase(), DynamicsPhase::bounced);
    s.advance_to(s.t_ns() + ns(10));
    EXPECT_EQ(s.ending(), Ending::bounced);
    EXPECT_GT(s.port().position_m().x, -0.01);
}

TEST(Contact, EachConditionOfTheEnvelopeCounts) {
    const CaptureEnvelope e;
    const auto turn = [](PortState& p, const Vec3& misalignment_deg) {
        p.T_port_chaser_port.q = T_port_docked().q * exp_rotation(kRadPerDeg * misalignment_deg);
    };
    PortState good{T_port_docked(), {}, {}};
    good.velocity_m_s.x = -0.07;
    EXPECT_TRUE(within(e, good));
    const auto refused = [&](auto&& change) {
        PortState p = good;
        change(p);
        return !within(e, p);
    };
    EXPECT_TRUE(refused([&](PortState& p) { p.velocity_m_s.x = -0.049; }));
    EXPECT_TRUE(refused([&](PortState& p) { p.velocity_m_s.x = -0.101; }));
    EXPECT_TRUE(refused([&](PortState& p) { p.velocity_m_s.y = 0.03, p.velocity_m_s.z = 0.03; }));
    EXPECT_TRUE(refused([&](PortState& p) { p.T_port_chaser_port.t = {0, 0.08, 0.08}; }));
    EXPECT_TRUE(refused([&](PortState& p) { turn(p, {4.1, 0, 0}); }));
    EXPECT_TRUE(refused([&](PortState& p) { turn(p, {0, 3, 3}); }));
    EXPECT_TRUE(refused([&](PortState& p) { p.rate_rad_s.x = 0.21 * kRadPerDeg; }));
    EXPECT_TRUE(refused([&](PortState& p) { p.rate_rad_s.y = p.rate_rad_s.z = 0.15 * kRadPerDeg; }));
    EXPECT_FALSE(refused([&](PortState& p) { p.T_port_chaser_port.t.y = 0.09, turn(p, {3.9, 0, 0}); }));
}

TEST(Contact, PortsPassEachOtherAtALargeLateralDistance) {
    Scenario scenario = closing(0.2);
    scenario.start.position_m.y = 1.1;
    Simulation s = simulate(scenario);
    s.advance_to(ns(10));
    EXPECT_EQ(s.t_ns(), ns(10));
    EXPECT_EQ(s.phase(), DynamicsPhase::flying);
    EXPECT_NEAR(s.port().position_m().x, -1.5, 1e-12);
}

TEST(Ending, IsAtTheDurationOrWhenTheNavigationIsDoneOrHasLeft) {
    Scenario scenario = quiet();
    scenario.duration_s = 20;
    Simulation s = simulate(scenario);
    s.advance_to(ns(19));
    EXPECT_EQ(s.ending(), Ending::not_yet);
    s.advance_to(ns(20));
    EXPECT_EQ(s.ending(), Ending::duration);

    ActuatorCommand command;
    Simulation done = simulate(scenario);
    command.phase = GuidancePhase::done;
    done.apply(command);
    EXPECT_EQ(done.ending(), Ending::navigation_done);

    scenario.start.velocity_m_s = {10, 0, 0};
    Simulation leaving = simulate(scenario);
    command.phase = GuidancePhase::retreating;
    leaving.apply(command);
    leaving.advance_to(ns(5.9));
    EXPECT_EQ(leaving.ending(), Ending::not_yet);
    leaving.advance_to(ns(6.1));
    EXPECT_EQ(leaving.ending(), Ending::left);
}

TEST(Start, IsWhereTheScenarioHasIt) {
    Scenario scenario = quiet(orbit_model("two-body"));
    scenario.q_world_target = normalized(Quat{1, 2, 3, 4});
    scenario.target.T_body_port.q = normalized(Quat{1, 0, 1, 0});
    scenario.chaser.T_body_port.q = normalized(Quat{1, 1, 0, 0});
    scenario.target_motion = {true, {0.1, 0.2, 0.3}};
    scenario.start.position_m = {60, 1, -2};
    scenario.start.velocity_m_s = {-0.1, 0.02, 0.03};
    scenario.start.attitude_deg = {1, -2, 3};
    scenario.start.rate_deg_s = {0.1, 0.2, -0.3};
    const Simulation s = simulate(scenario);
    expect_near(s.port().position_m(), scenario.start.position_m, 1e-12);
    expect_near(s.port().velocity_m_s, scenario.start.velocity_m_s, 1e-12);
    expect_near(s.port().misalignment_rad() / kRadPerDeg, scenario.start.attitude_deg, 1e-10);
    expect_near(scenario.chaser.T_body_port.q * s.port().rate_rad_s / kRadPerDeg, scenario.start.rate_deg_s, 1e-10);
    // Docked, the ports' x axes are opposite, and their z axes the same.
    scenario.start.attitude_deg = {};
    const Truth truth = simulate(scenario).truth();
    const Quat q_target = truth.target.T_world_body.q * scenario.target.T_body_port.q;
    const Quat q_chaser = truth.chaser.T_world_body.q * scenario.chaser.T_body_port.q;
    expect_near(q_target * Vec3{1, 0, 0}, q_chaser * Vec3{-1, 0, 0}, 1e-12);
    expect_near(q_target * Vec3{0, 0, 1}, q_chaser * Vec3{0, 0, 1}, 1e-12);
}

TEST(Start, HasTheScenariosDispersion) {
    Scenario scenario = quiet();
    scenario.start.position_sigma_m = {1, 2, 3};
    scenario.start.velocity_sigma_m_s = {0.01, 0.02, 0.03};
    scenario.start.attitude_sigma_deg = {0.1, 0.2, 0.3};
    scenario.start.rate_sigma_deg_s = {0.01, 0.02, 0.03};
    const int kRuns = 2000;
    Vec3 sum[4], squares[4];
    for (int seed = 1; seed <= kRuns; ++seed) {
        const PortState p = simulate(scenario, seed).port();
        const Vec3 off[4] = {p.position_m() - scenario.start.position_m, p.velocity_m_s,
                             p.misalignment_rad() / kRadPerDeg, p.rate_rad_s / kRadPerDeg};
        for (int k = 0; k < 4; ++k)
            for (int i = 0; i < 3; ++i) sum[k][i] += off[k][i], squares[k][i] += off[k][i] * off[k][i];
    }
    const Vec3 sigmas[4] = {scenario.start.position_sigma_m, scenario.start.velocity_sigma_m_s,
                            scenario.start.attitude_sigma_deg, scenario.start.rate_sigma_deg_s};
    for (int k = 0; k < 4; ++k)
        for (int i = 0; i < 3; ++i) {
            EXPECT_NEAR(sum[k][i] / kRuns / sigmas[k][i], 0, 4 / std::sqrt(kRuns)) << k << i;
            EXPECT_NEAR(std::sqrt(squares[k][i] / kRuns) / sigmas[k][i], 1, 4 / std::sqrt(2 * kRuns)) << k << i;
        }
}

TEST(AttitudeSensor, HasTheScenariosNoise) {
    Scenario scenario = quiet();
    scenario.attitude_sensor = {0.01, 0.004};
    scenario.start.rate_deg_s = {0.1, 0, 0};
    Simulation s = simulate(scenario);
    const int kReports = 2000;
    double attitude = 0, rate = 0;
    for (int i = 0; i < kReports; ++i) {
        const AttitudeReport report = s.measure_attitude();
        const Motion truth = s.truth().chaser;
        const Vec3 a = rotation_vector(conjugate(truth.T_world_body.q) * report.q_world_chaser) / kRadPerDeg;
        const Vec3 r = (report.rate_rad_s - truth.rate_rad_s) / kRadPerDeg;
        attitude += dot(a, a), rate += dot(r, r);
    }
    EXPECT_NEAR(std::sqrt(attitude / 3 / kReports), 0.01, 4 * 0.01 / std::sqrt(6 * kReports));
    EXPECT_NEAR(std::sqrt(rate / 3 / kReports), 0.004, 4 * 0.004 / std::sqrt(6 * kReports));
}

TEST(Draws, ForOnePurposeDoNotShiftOthers) {
    Scenario scenario = quiet();
    scenario.thrusters.misalignment_sigma_deg = 0.5;
    scenario.attitude_sensor = {0.01, 0.004};
    Simulation a = simulate(scenario, 5), b = simulate(scenario, 5);
    (void)b.measure_attitude();
    (void)b.measure_attitude();
    ActuatorCommand command;
    command.impulse_n_s = {100, -50, 20};
    for (Simulation* s : {&a, &b}) {
        s->apply(command);
        s->advance_to(ns(1));
    }
    EXPECT_EQ(a.port().position_m(), b.port().position_m());
    EXPECT_NE(simulate(scenario, 6).thrusters().directions()[0], a.thrusters().directions()[0]);
}

}  // namespace
}  // namespace narpa::rehearsal
