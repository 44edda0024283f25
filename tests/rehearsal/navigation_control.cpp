// Guidance along the legs, and the control of the port in closed loop with a rigid body.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "tests/rehearsal/navigation_plant.h"

namespace narpa::rehearsal {
namespace {

Leg straight(const Vec3& to_m, double speed_m_s) {
    Leg leg;
    leg.to_m = to_m;
    leg.speed_m_s = speed_m_s;
    return leg;
}

TEST(LegPath, IsContinuousReachesItsEndAndKeepsItsLimits) {
    Leg arc;
    arc.arc_deg = -90;
    arc.axis = {0, 0, 1};
    arc.speed_m_s = 0.3;
    constexpr double a = 0.01;
    for (const Leg& leg : {straight({5, 1, -2}, 0.4), straight({24.5, 0, 0}, 0.4), arc}) {
        const Vec3 from{25, 0, 0};
        const LegPath path = LegPath::along(leg, from, a);
        const bool curved = leg.arc_deg.has_value();
        EXPECT_EQ(path.position_m(-1), from);
        EXPECT_EQ(norm(path.velocity_m_s(0)), 0);
        constexpr double dt = 0.01;
        for (double t = 0; t < path.duration_s() + 1; t += dt) {
            const Vec3 v = path.velocity_m_s(t), next = path.velocity_m_s(t + dt);
            ASSERT_LE(norm(v), leg.speed_m_s + 1e-12);
            ASSERT_LE(norm(next - v), dt * (a + (curved ? 0.3 * 0.3 / 25 : 0)) + 1e-12);
            ASSERT_NEAR(norm(path.position_m(t + dt) - path.position_m(t) - 0.5 * dt * (v + next)), 0, 1e-5);
        }
        EXPECT_LT(norm(path.velocity_m_s(path.duration_s() + 1)), 1e-12);
        const Vec3 end = curved ? Vec3{0, -25, 0} : leg.to_m;
        EXPECT_LT(norm(path.position_m(path.duration_s()) - end), 1e-9);
        EXPECT_LT(norm(path.end_m() - end), 1e-9);
    }
}

TEST(LegPath, ToContactContinuesAtItsSpeed) {
    Leg leg = straight({0, 0, 0}, 0.075);
    leg.contact = true;
    const LegPath path = LegPath::along(leg, {3, 0, 0}, 0.01);
    EXPECT_TRUE(std::isinf(path.duration_s()));
    EXPECT_LT(path.position_m(60).x, -1);
    EXPECT_LT(norm(path.velocity_m_s(60) - Vec3{-0.075, 0, 0}), 1e-15);
}

TEST(LegPath, AwayReversesTheSpeedFirst) {
    const LegPath path = LegPath::away({2, 0, 0}, {1, 0, 0}, -0.1, 0.3, 0.02);
    EXPECT_EQ(path.velocity_m_s(0), (Vec3{-0.1, 0, 0}));
    EXPECT_NEAR(path.position_m(5).x, 2 - 0.25, 1e-12);
    EXPECT_NEAR(path.velocity_m_s(20).x, 0.3, 1e-12);
    EXPECT_NEAR(path.velocity_m_s(200).x, 0.3, 1e-12);
}

GuidanceInput at(const Guidance& g, double t_s) {
    const Reference r = g.reference(t_s);
    return {t_s, r.position_m, r.velocity_m_s, 0.01, 0, DynamicsPhase::flying};
}

/// Where it first has the phase; NaN: not within ten minutes.
double when(Guidance& g, GuidancePhase phase, double from_s = 0) {
    for (double t = from_s; t < 600; t += 1) {
        g.step(at(g, t));
        if (g.phase() == phase) return t;
    }
    return std::nan("");
}

TEST(Guidance, FliesTheLegsHoldsAndDocks) {
    const Scenario s = docking_scenario();
    Guidance g(s, 0);
    const double held = when(g, GuidancePhase::holding);
    EXPECT_GT(held, 30);
    EXPECT_EQ(g.leg(), 0u);
    EXPECT_LT(norm(g.reference(held).position_m - Vec3{12, 0, 0}), 1e-9);
    const double moved = when(g, GuidancePhase::moving, held);
    EXPECT_NEAR(moved, held + 10, 1.001);
    EXPECT_EQ(g.leg(), 1u);
    const double closed = when(g, GuidancePhase::closing, moved);
    EXPECT_EQ(g.leg(), 2u);
    GuidanceInput input = at(g, closed + 45);
    EXPECT_NEAR(input.port_velocity_m_s.x, -0.075, 1e-12);
    input.dynamics = DynamicsPhase::captured;
    input.unmeasured_s = 1000;  // the port is too near to be seen
    g.step(input);
    EXPECT_EQ(g.phase(), GuidancePhase::docked);
    EXPECT_TRUE(g.thrusters_off());
    EXPECT_EQ(norm(g.reference(closed + 60).position_m), 0);
    EXPECT_EQ(g.abort(), AbortReason::none);
}

TEST(Guidance, AHoldLastsUntilTheEstimateIsNear) {
    const Scenario s = docking_scenario();
    Guidance g(s, 0);
    const double held = when(g, GuidancePhase::holding);
    for (double t = held; t < held + 60; t += 1) {
        GuidanceInput input = at(g, t);
        input.port_m.y += 0.31;
        g.step(input);
        ASSERT_EQ(g.phase(), GuidancePhase::holding);
    }
    g.step(at(g, held + 60));
    EXPECT_EQ(g.phase(), GuidancePhase::moving);
}

TEST(Guidance, ARetreatNearThePortStopsBeforeIt) {
    const Scenario s = docking_scenario();
    Guidance g(s, 0);
    GuidanceInput input = at(g, 0);
    input.port_m = {0.15, 0.01, 0};
    input.port_velocity_m_s = {-0.075, 0, 0};
    input.unmeasured_s = 100;
    g.step(input);
    ASSERT_EQ(g.abort(), AbortReason::lost);
    for (double t = 0; t < 30; t += 0.1) EXPECT_GT(g.reference(t).position_m.x, 0) << t;
    EXPECT_GT(g.reference(30).position_m.x, 5);
}

TEST(Guidance, AbortsForEachReason) {
    const Scenario s = docking_scenario();
    const auto reason = [&](const auto& change) {
        Guidance g(s, 0);
        for (double t = 0; t < 30; t += 1) g.step(at(g, t));
        GuidanceInput input = at(g, 30);
        change(input);
        g.step(input);
        EXPECT_EQ(g.phase() == GuidancePhase::retreating, g.abort() != AbortReason::none);
        if (g.phase() == GuidancePhase::retreating) {
            // Away along the port's axis, from where it is and as fast as it is, or from rest.
            EXPECT_LT(norm(g.reference(30).position_m - input.port_m), 1e-12);
            const bool bounced = g.abort() == AbortReason::bounced;
            EXPECT_NEAR(g.reference(30).velocity_m_s.x, bounced ? 0 : input.port_velocity_m_s.x, 1e-12);
            EXPECT_NEAR(g.reference(300).velocity_m_s.x, s.control.retreat_m_s, 1e-12);
            EXPECT_GT(g.reference(300).position_m.x, input.port_m.x + 20);
        }
        return g.abort();
    };
    EXPECT_EQ(reason([](GuidanceInput&) {}), AbortReason::none);
    EXPECT_EQ(reason([](GuidanceInput& i) { i.unmeasured_s = 20.5; }), AbortReason::lost);
    EXPECT_EQ(reason([](GuidanceInput& i) { i.position_sigma_m = 2.1; }), AbortReason::uncertain);
    EXPECT_EQ(reason([](GuidanceInput& i) { i.position_sigma_m = std::nan(""); }), AbortReason::uncertain);
    EXPECT_EQ(reason([](GuidanceInput& i) { i.port_m.z += 5.1; }), AbortReason::off_reference);
    EXPECT_EQ(reason([](GuidanceInput& i) { i.dynamics = DynamicsPhase::bounced; }), AbortReason::bounced);
}

TEST(Guidance, PointsAtTheTargetAlongAnArc) {
    Scenario s = docking_scenario();
    Leg arc;
    arc.arc_deg = 180;
    arc.axis = {0, 0, 1};
    arc.look_at_target = true;
    arc.speed_m_s = 0.5;
    s.legs = {arc};
    s.start.position_m = {20, 0, 3};
    Guidance g(s, 0);
    for (double t = 1; t < 100; t += 1) {
        const Reference r = g.reference(t), next = g.reference(t + 1);
        ASSERT_LT(norm(r.q_port_chaser_port * Vec3{1, 0, 0} + normalized(r.position_m)), 1e-12);
        ASSERT_GT((r.q_port_chaser_port * Vec3{0, 0, 1}).z, 0.9);
        // Rates are those of the attitude; the mean acceleration leads from rate to rate.
        const Vec3 turned = rotation_vector(next.q_port_chaser_port * conjugate(r.q_port_chaser_port));
        ASSERT_LT(norm(turned - 0.5 * (r.rate_rad_s + next.rate_rad_s)), 2e-4);
        ASSERT_LT(norm(next.rate_rad_s - r.rate_rad_s - r.angular_acceleration_rad_s2), 1e-12);
    }
}

TEST(SampledGains, PlaceTheDiscretizedPoles) {
    // Under them a double integrator falls as the continuous loop does, however long the period.
    for (const double period_s : {0.1, 1.0, 5.0}) {
        const SampledGains k = SampledGains::of(0.15, 0.9, period_s);
        double x = 1, v = 0, t = 0;
        for (; t < 60; t += period_s) {
            const double a = -k.position_s2 * x - k.velocity_s * v;
            v += a * period_s;
            x += v * period_s;
        }
        EXPECT_LT(std::abs(x), std::exp(-0.9 * 0.15 * t) * 5) << period_s;
        EXPECT_GT(k.position_s2, 0);
    }
}

TEST(PulseAxis, SmallForcesAreRightInTheMean) {
    PulseAxis axis(8, 400);
    double given = 0;
    for (int i = 0; i < 1000; ++i) {
        const double pulse = axis.modulate(-0.7);
        ASSERT_TRUE(pulse == 0 || std::abs(pulse) >= 8);
        given += pulse;
        ASSERT_LE(std::abs(given + 0.7 * (i + 1)), 8);
    }
    EXPECT_EQ(axis.modulate(1e4), 400);
    EXPECT_EQ(axis.modulate(0), 0) << "what was too much is not made up for";
}

struct Loop {
    Plant plant;
    FlightControl control;
    explicit Loop(const Scenario& s) : plant{s}, control(s) {}
    void fly(const Reference& reference) {
        plant.fly(control.step(plant.t_s, plant.motion, reference), plant.scenario.navigation.period_s);
    }
};

Reference standing(const Vec3& at_m) {
    Reference r;
    r.position_m = at_m;
    r.q_port_chaser_port = T_port_docked().q;
    return r;
}

/// Off the V-bar, where gravity pulls, from a metre and three degrees off; then it stays, within what one least
/// pulse a control period does: 8 N s / 9500 kg = 0.84 mm/s.
TEST(FlightControl, MovesThePortToTheReferenceAndHoldsIt) {
    Loop loop(docking_scenario());
    loop.plant.stand({30, 11, -9}, {0.05, -0.03, 0.04});
    const Reference r = standing({30, 10, -10});
    for (int k = 0; k < 120; ++k) loop.fly(r);
    double worst_m = 0, worst_rad = 0;
    for (int k = 0; k < 300; ++k) {
        loop.fly(r);
        worst_m = std::max(worst_m, norm(loop.plant.port().T_port_chaser_port.t - r.position_m));
        worst_rad = std::max(worst_rad, loop.plant.off_docked_rad());
    }
    EXPECT_LT(worst_m, 0.02);
    EXPECT_LT(worst_rad, 0.2 * kRadPerDeg);
}

/// The port is 3.2 m before the centre of mass: it stays in place while the chaser rotates by ten degrees.
TEST(FlightControl, ThePortStaysWhileTheChaserRotates) {
    Loop loop(docking_scenario());
    loop.plant.stand({10, 0, 0}, {0, 0.17, 0});
    const Reference r = standing({10, 0, 0});
    double worst_m = 0, centre_m = 0;
    const Vec3 before = loop.plant.motion.position_m;
    for (int k = 0; k < 200; ++k) {
        loop.fly(r);
        worst_m = std::max(worst_m, norm(loop.plant.port().T_port_chaser_port.t - r.position_m));
        centre_m = std::max(centre_m, norm(loop.plant.motion.position_m - before));
    }
    EXPECT_LT(loop.plant.off_docked_rad(), 0.2 * kRadPerDeg);
    EXPECT_GT(centre_m, 0.5);
    EXPECT_LT(worst_m, 0.08);
}

/// All legs with a perfect estimate: follows within centimetres, meets the port at its speed.
TEST(FlightControl, FollowsTheLegsToContact) {
    const Scenario s = docking_scenario();
    Loop loop(s);
    loop.plant.stand(s.start.position_m, {});
    Guidance g(s, 0);
    double worst_m = 0;
    while (loop.plant.t_s < 400 && loop.plant.port().T_port_chaser_port.t.x > 0) {
        const PortState port = loop.plant.port();
        g.step({loop.plant.t_s, port.T_port_chaser_port.t, port.velocity_m_s, 0.01, 0, DynamicsPhase::flying});
        const Reference r = g.reference(loop.plant.t_s);
        worst_m = std::max(worst_m, norm(port.T_port_chaser_port.t - r.position_m));
        loop.fly(r);
    }
    EXPECT_EQ(g.phase(), GuidancePhase::closing);
    EXPECT_LT(worst_m, 0.02);
    const PortState port = loop.plant.port();
    EXPECT_NEAR(port.velocity_m_s.x, -0.075, 0.005);
    EXPECT_LT(std::hypot(port.velocity_m_s.y, port.velocity_m_s.z), 0.005);
    EXPECT_LT(std::hypot(port.T_port_chaser_port.t.y, port.T_port_chaser_port.t.z), 0.02);
    EXPECT_LT(loop.plant.off_docked_rad(), 0.3 * kRadPerDeg);
}

/// Before the port of a target that turns it stays where it is, and turns with it.
TEST(FlightControl, FollowsARotatingTarget) {
    Scenario s = docking_scenario();
    s.target_motion.with_lvlh = false;
    s.target_motion.rate_deg_s = {0, 0, 0.15};
    Loop loop(s);
    loop.plant.stand({8, 0, 0}, {});
    const Reference r = standing({8, 0, 0});
    double worst_m = 0;
    for (int k = 0; k < 300; ++k) {
        loop.fly(r);
        worst_m = std::max(worst_m, norm(loop.plant.port().T_port_chaser_port.t - r.position_m));
    }
    EXPECT_LT(worst_m, 0.05);
    EXPECT_LT(loop.plant.off_docked_rad(), 0.2 * kRadPerDeg);
}

TEST(RelativeMotion, RoundTripsAndVelocityIsItsRateOfChange) {
    Scenario s = docking_scenario();
    s.target_motion.rate_deg_s = {0.2, -0.1, 0.3};
    s.chaser.T_body_port = {exp_rotation({0.1, 0.2, -0.3}), {0.2, -0.1, 0.3}};
    Plant plant{s};
    plant.stand({20, 3, -2}, {0.1, -0.2, 0.05});
    plant.motion.chaser_rate_rad_s = {0.01, -0.02, 0.005};
    place_port({20, 3, -2}, {0.1, -0.2, 0.3}, s.target, s.chaser, plant.motion);
    const PortState before = plant.port();
    EXPECT_LT(norm(before.T_port_chaser_port.t - Vec3{20, 3, -2}), 1e-9);
    EXPECT_LT(norm(before.velocity_m_s - Vec3{0.1, -0.2, 0.3}), 1e-12);

    const RelativeState state = in_frame(plant.motion, s.orbit, 77);
    const RelativeMotion back =
        in_world(state, s.orbit, 77, plant.motion.q_world_chaser, plant.motion.chaser_rate_rad_s);
    EXPECT_LT(norm(back.position_m - plant.motion.position_m), 1e-9);
    EXPECT_LT(norm(back.velocity_m_s - plant.motion.velocity_m_s), 1e-12);
    EXPECT_LT(angle_between(back.q_world_target, plant.motion.q_world_target), 1e-12);

    constexpr double dt = 1e-4;
    plant.step({}, {}, dt);
    const Vec3 moved = (plant.port().T_port_chaser_port.t - before.T_port_chaser_port.t) / dt;
    EXPECT_LT(norm(moved - before.velocity_m_s), 1e-4);
}

}  // namespace
}  // namespace narpa::rehearsal
