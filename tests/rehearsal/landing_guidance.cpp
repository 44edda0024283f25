// Powered descent: its path, when it is planned, and the engine that follows it.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "base/constants.h"
#include "rehearsal/navigation/guidance/flight_control.h"
#include "tests/support/paths.h"

namespace narpa::rehearsal {
namespace {

void expect_close(const Vec3& a, const Vec3& b, double within) {
    EXPECT_LT(norm(a - b), within) << a.x << " " << a.y << " " << a.z << " is not " << b.x << " " << b.y << " "
                                   << b.z;
}

TEST(DescentPath, JoinsBothStatesAndEndsWithoutAcceleration) {
    const Vec3 from{1200, 60, -600}, along{-48, -3, 26}, to{25, 1, 2}, at_end{-2, 0.1, 0};
    const DescentPath path(from, along, to, at_end, 45);
    expect_close(path.position_m(-45), from, 1e-9);
    expect_close(path.velocity_m_s(-45), along, 1e-9);
    expect_close(path.position_m(0), to, 1e-12);
    expect_close(path.velocity_m_s(0), at_end, 1e-12);
    expect_close(path.acceleration_m_s2(0), {}, 1e-12);
    expect_close(path.position_m(2), to + 2 * at_end, 1e-12);
    for (double t = -44; t < 0; t += 1.7) {
        constexpr double h = 1e-4;
        expect_close((path.position_m(t + h) - path.position_m(t - h)) / (2 * h), path.velocity_m_s(t), 1e-5);
        expect_close((path.velocity_m_s(t + h) - path.velocity_m_s(t - h)) / (2 * h), path.acceleration_m_s2(t),
                     1e-5);
    }
}

Scenario landing() {
    auto s = read_scenario(test::build_path("scenes/rehearsal/landing.toml"));
    EXPECT_TRUE(s) << s.error().text();
    return *std::move(s);
}

GuidanceInput at(double t_s, const Vec3& port_m, const Vec3& velocity_m_s) {
    return {t_s, port_m, velocity_m_s, 0.01, 0, DynamicsPhase::flying};
}

TEST(DescentGuidance, IsPlannedFromTheEstimateUntilShortlyBeforeItsEnd) {
    const Scenario s = landing();
    Guidance g(s, 0);
    const Vec3 off{30, -20, 10};
    g.step(at(0, s.start.position_m + off, s.start.velocity_m_s));
    expect_close(g.reference(0).position_m, s.start.position_m + off, 1e-9);
    g.step(at(20, {500, 30, -100}, {-25, 0, 5}));
    expect_close(g.reference(20).position_m, {500, 30, -100}, 1e-9);
    EXPECT_EQ(g.abort(), AbortReason::none);
    const Vec3 planned = g.reference(40).position_m;
    g.step(at(40, planned + Vec3{3, 0, 0}, {-5, 0, 0}));
    expect_close(g.reference(40).position_m, planned, 1e-9);
    EXPECT_EQ(g.phase(), GuidancePhase::braking);
}

TEST(DescentGuidance, GoesOverIntoTheVerticalDescentWithoutAJump) {
    const Scenario s = landing();
    Guidance g(s, 0);
    g.step(at(0, s.start.position_m, s.start.velocity_m_s));
    const double end_s = *s.legs[0].descent_s;
    const Reference before = g.reference(end_s);
    g.step(at(end_s, s.legs[0].to_m, s.legs[0].end_velocity_m_s));
    EXPECT_EQ(g.phase(), GuidancePhase::terminal_descent);
    EXPECT_EQ(g.leg(), 1u);
    const Reference after = g.reference(end_s);
    expect_close(after.position_m, before.position_m, 1e-9);
    expect_close(after.velocity_m_s, before.velocity_m_s, 1e-9);
    expect_close(g.reference(end_s + 10).velocity_m_s, {-s.legs[1].speed_m_s, 0, 0}, 1e-9);
}

TEST(DescentGuidance, StopsTheEngineAtTouchdown) {
    const Scenario s = landing();
    for (const DynamicsPhase phase : {DynamicsPhase::touched_down, DynamicsPhase::landed, DynamicsPhase::crashed}) {
        Guidance g(s, 0);
        EXPECT_FALSE(g.thrusters_off());
        GuidanceInput touched = at(50, {0, 0, 0}, {});
        touched.dynamics = phase;
        g.step(touched);
        EXPECT_EQ(g.phase(), GuidancePhase::landed);
        EXPECT_TRUE(g.thrusters_off());
    }
}

/// The lander upright over the site, at rest on the ground's axes.
RelativeMotion upright(const Scenario& s, const Vec3& port_m) {
    RelativeMotion m;
    m.q_world_target = s.q_world_target;
    m.target_rate_rad_s = nominal_target_rate_rad_s(s);
    m.q_world_chaser =
        m.q_world_target * s.target.T_body_port.q * T_port_docked().q * conjugate(s.chaser.T_body_port.q);
    m.chaser_rate_rad_s = conjugate(m.q_world_chaser) * (m.q_world_target * m.target_rate_rad_s);
    place_port(port_m, {}, s.target, s.chaser, m);
    return m;
}

TEST(EngineControl, HoversOnItsWeight) {
    const Scenario s = landing();
    FlightControl control(s);
    Reference r;
    r.position_m = {100, 0, 0};
    r.q_port_chaser_port = T_port_docked().q;
    const RelativeMotion m = upright(s, r.position_m);
    const Impulses i = control.step(0, m, r);
    const double weight = s.chaser.mass_kg * norm(s.orbit.relative_free_fall_m_s2(0, m.position_m));
    EXPECT_NEAR(i.linear_n_s.z, weight * s.navigation.period_s, 1e-3 * weight);
    EXPECT_LT(std::hypot(i.linear_n_s.x, i.linear_n_s.y), 1e-3 * weight);
}

TEST(EngineControl, TiltsToWhereTheForceIsNeededAndNoFurtherThanItMay) {
    Scenario s = landing();
    s.control.turn_deg_s = 1e3;
    s.thrusters.torque_n_m = 1e6;
    s.thrusters.min_on_s = 0;
    for (const double far_m : {2.0, 1e4}) {
        FlightControl control(s);
        Reference r;
        r.position_m = {100, 0, far_m};  // east: the lander's x
        r.q_port_chaser_port = T_port_docked().q;
        const Impulses i = control.step(0, upright(s, {100, 0, 0}), r);
        // About y by the angle wanted: the controller's first torque is in proportion.
        const double bandwidth =
            SampledGains::of(s.control.attitude_bandwidth_rad_s, s.control.damping, s.navigation.period_s)
                .position_s2;
        const double tilt_deg =
            i.angular_n_m_s.y / (s.navigation.period_s * s.chaser.inertia_kg_m2(1, 1) * bandwidth) / kDegree;
        if (far_m > 100)
            EXPECT_NEAR(tilt_deg, s.engine->tilt_most_deg, 0.1);
        else
            EXPECT_TRUE(tilt_deg > 1 && tilt_deg < 20) << tilt_deg;
        EXPECT_NEAR(i.angular_n_m_s.x, 0, 0.05 * i.angular_n_m_s.y);
        EXPECT_LE(i.linear_n_s.z, s.engine->most_n * s.navigation.period_s + 1e-9);
    }
}

}  // namespace
}  // namespace narpa::rehearsal
