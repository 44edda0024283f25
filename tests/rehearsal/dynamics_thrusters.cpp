// What thrusters make of commands, and what goes wrong with them.

#include "base/constants.h"
#include "tests/rehearsal/dynamics_support.h"

namespace narpa::rehearsal {
namespace {

ActuatorCommand command(const Vec3& impulse_n_s, const Vec3& angular_impulse_n_m_s = {}) {
    ActuatorCommand c;
    c.impulse_n_s = impulse_n_s;
    c.angular_impulse_n_m_s = angular_impulse_n_m_s;
    return c;
}

/// One control period of this command.
Loads fired(Simulation& s, const ActuatorCommand& c, double period_s = 1) {
    const Loads before = s.fired();
    s.apply(c);
    s.advance_to(s.t_ns() + ns(period_s));
    return {s.fired().force_n - before.force_n, s.fired().torque_n_m - before.torque_n_m};
}

TEST(Thrusters, FireEachAxisInItsDirectionAtFullForce) {
    Simulation s = simulate(quiet());
    const Motion before = s.truth().chaser;
    const Loads loads = fired(s, command({20, -60.123456, 333.3}, {-9, 31.4159, 250}));
    expect_near(loads.force_n, {20, -60.123456, 333.3}, 1e-10);
    expect_near(loads.torque_n_m, {-9, 31.4159, 250}, 1e-10);
    EXPECT_GT(norm(s.truth().chaser.rate_rad_s), norm(before.rate_rad_s));
}

TEST(Thrusters, MoveTheCentreOfMassByImpulseOverMass) {
    Scenario scenario = quiet();
    Simulation s = simulate(scenario);
    // The chaser faces the target: its x axis is the port's -x.
    fired(s, command({50, 0, 0}));
    expect_near(s.port().velocity_m_s, {-50 / scenario.chaser.mass_kg, 0, 0}, 1e-12);
    // 0.125 s at full force, then coasting: the position shows when it fired.
    const double on_s = 50 / scenario.thrusters.force_n;
    EXPECT_NEAR(s.port().position_m().x, 60 - 0.005 * (1 - on_s / 2), 1e-12);
    fired(s, command({}, {3, 0, 0}));
    EXPECT_NEAR(s.port().rate_rad_s.x, 0, 1e-15) << "3 N m s is 7.5 ms of 400 N m: not fired";
    fired(s, command({}, {30, 0, 0}));
    EXPECT_NEAR(s.port().rate_rad_s.x, 30 / 15e3, 1e-12);
}

TEST(Thrusters, FireNoLessThanTheShortestPulseAndNoLongerThanThePeriod) {
    Simulation s = simulate(quiet());  // 400 N, 20 ms: 8 N s
    expect_near(fired(s, command({7.99, -7.99, 0})).force_n, {}, 0);
    expect_near(fired(s, command({8.01, 0, -8.01})).force_n, {8.01, 0, -8.01}, 1e-12);
    expect_near(fired(s, command({1e4, 0, 0})).force_n, {400, 0, 0}, 1e-10);
    expect_near(fired(s, command({})).force_n, {}, 0);
}

TEST(Thrusters, ANewCommandReplacesTheRestOfTheLast) {
    Simulation s = simulate(quiet());
    s.apply(command({400, 0, 0}));
    s.advance_to(ns(0.25));
    s.apply(command({0, 40, 0}));
    s.advance_to(ns(3));
    expect_near(s.fired().force_n, {100, 40, 0}, 1e-10);
}

TEST(Thrusters, PulseErrorsHaveTheScenariosDeviation) {
    Scenario scenario = quiet();
    scenario.thrusters.gain_sigma = 0.02;
    Simulation s = simulate(scenario, 7);
    const int kPulses = 2000;
    double sum = 0, squares = 0;
    for (int i = 0; i < kPulses; ++i) {
        const double gain =
            fired(s, command({0, i % 2 == 0 ? 20.0 : -20.0, 0})).force_n.y / 20 * (i % 2 == 0 ? 1 : -1);
        sum += gain - 1, squares += (gain - 1) * (gain - 1);
    }
    EXPECT_NEAR(sum / kPulses, 0, 4 * 0.02 / std::sqrt(kPulses));
    EXPECT_NEAR(std::sqrt(squares / kPulses), 0.02, 4 * 0.02 / std::sqrt(2 * kPulses));
}

TEST(Thrusters, MisalignmentOfAGroupIsConstantInARun) {
    Scenario scenario = quiet();
    scenario.thrusters.misalignment_sigma_deg = 0.5;
    double squares = 0;
    const int kRuns = 300;
    for (int seed = 0; seed < kRuns; ++seed) {
        const auto directions = simulate(scenario, seed).thrusters().directions();
        for (int group = 0; group < kThrusterGroups; ++group) {
            EXPECT_NEAR(norm(directions[group]), 1, 1e-14);
            Vec3 axis;
            axis[group % 6 / 2] = group % 2 == 0 ? 1 : -1;
            squares += dot(cross(axis, directions[group]), cross(axis, directions[group]));
        }
    }
    const double n = 2.0 * kRuns * kThrusterGroups;  // two directions across
    EXPECT_NEAR(std::sqrt(squares / n) / kRadPerDeg, 0.5, 4 * 0.5 / std::sqrt(2 * n));

    Simulation s = simulate(scenario, 3);
    const Vec3 first = fired(s, command({40, 0, 0})).force_n, second = fired(s, command({40, 0, 0})).force_n;
    expect_near(first, 40.0 * s.thrusters().directions()[0], 1e-12);
    expect_near(second, first, 1e-12);
}

Scenario with_fault(const FaultKind* kind, double from_s, double until_s, const std::string& axis = "",
                    const Vec3& value = {}) {
    Scenario s = quiet();
    s.faults.push_back({kind, from_s, until_s, axis, value});
    return s;
}

TEST(Faults, AGroupThatIsOffStopsAtThatInstant) {
    Simulation s = simulate(with_fault(fault_kind("thruster_off"), 0.3, 2.9, "+fx"));
    expect_near(fired(s, command({200, 200, 0})).force_n, {400 * 0.3, 200, 0}, 1e-10);
    expect_near(fired(s, command({-200, 0, 0})).force_n, {-200, 0, 0}, 1e-10);  // the group opposite is well
    expect_near(fired(s, command({400, 0, 0})).force_n, {400 * 0.1, 0, 0}, 1e-10);
}

TEST(Faults, AGroupThatIsStuckFiresWhateverIsCommanded) {
    Simulation s = simulate(with_fault(fault_kind("thruster_stuck"), 0.5, 1.25, "-ty"));
    expect_near(fired(s, command({})).torque_n_m, {0, -400 * 0.5, 0}, 1e-10);
    expect_near(fired(s, command({}, {0, -100, 0})).torque_n_m, {0, -400 * 0.25, 0}, 1e-10);
    expect_near(fired(s, command({}, {0, 100, 0})).torque_n_m, {0, 100, 0}, 1e-10);
}

TEST(Faults, TheAttitudeSensorIsBiasedWhileItLasts) {
    Simulation s = simulate(with_fault(fault_kind("attitude_bias"), 10, 20, "", {0, 0, 2}));
    const auto off_deg = [&](double t_s) {
        s.advance_to(ns(t_s));
        return rotation_vector(conjugate(s.truth().chaser.T_world_body.q) * s.measure_attitude().q_world_chaser) /
               kRadPerDeg;
    };
    expect_near(off_deg(9.9), {}, 1e-12);
    expect_near(off_deg(10), {0, 0, 2}, 1e-9);
    expect_near(off_deg(20), {}, 1e-12);
}

TEST(Faults, TheTargetsRateChangesAndChangesBack) {
    Scenario scenario = with_fault(fault_kind("target_rate"), 10.01, 20, "", {0.5, 0, 0});
    Simulation s = simulate(scenario);
    s.advance_to(ns(12.01));
    EXPECT_NEAR(rotation_vector(s.truth().target.T_world_body.q).x / kRadPerDeg, 1, 1e-9);
    expect_near(s.truth().target.rate_rad_s / kRadPerDeg, {0.5, 0, 0}, 1e-12);
    s.advance_to(ns(30));
    expect_near(s.truth().target.rate_rad_s, {}, 1e-15);
    EXPECT_NEAR(rotation_vector(s.truth().target.T_world_body.q).x / kRadPerDeg, 0.5 * 9.99, 1e-9);

    scenario.faults[0].from_s = 0;
    expect_near(simulate(scenario).truth().target.rate_rad_s / kRadPerDeg, {0.5, 0, 0}, 1e-12);
}

TEST(Faults, CommandsAreLostWhileItLasts) {
    Simulation s = simulate(with_fault(fault_kind("commands_lost"), 1, 2));
    expect_near(fired(s, command({100, 0, 0})).force_n, {100, 0, 0}, 1e-10);
    EXPECT_FALSE(s.apply(command({100, 0, 0})));
    expect_near(fired(s, command({100, 0, 0})).force_n, {}, 0);
    EXPECT_TRUE(s.apply(command({100, 0, 0})));
}

}  // namespace
}  // namespace narpa::rehearsal
