// How bodies move by themselves: orbits, tumbling.
#include "base/constants.h"
#include "estimator/filter/motion_model.h"
#include "rehearsal/dynamics/rigid_body.h"
#include "rehearsal/orbit/orbit.h"
#include "tests/rehearsal/dynamics_support.h"

namespace narpa::rehearsal {
namespace {

Orbit orbit_of(const OrbitModel* model) {
    Orbit orbit;
    orbit.model = model;
    orbit.up = normalized(Vec3{1, 2, -1});
    orbit.along = normalized(Vec3{1, 0, 1});
    return orbit;
}
double period_s(const Orbit& orbit) {
    return 2 * 3.14159265358979323846 / orbit.rate_rad_s();
}

/// As LVLH sees it at time 0, in world axes.
Translation from_lvlh(const Orbit& orbit, const Vec3& position, const Vec3& velocity) {
    const Quat q = orbit.q_world_frame(0);
    return {q * position, q * (velocity + cross(Vec3{0, 0, orbit.rate_rad_s()}, position))};
}
Vec3 position_in_lvlh(const Orbit& orbit, double t_s, const Translation& x) {
    return conjugate(orbit.q_world_frame(t_s)) * x.position_m;
}

TEST(OrbitMotion, AFreeBodyFollowsItsVelocityAndAcceleration) {
    const Translation x = propagated(orbit_of(orbit_model("free")), 5, 2, {0, 0, 1}, {{1, 2, 3}, {4, 5, 6}});
    expect_near(x.position_m, {9, 12, 17}, 1e-12);
    expect_near(x.velocity_m_s, {4, 5, 8}, 1e-12);
}

TEST(OrbitMotion, ClohessyWiltshireClosesItsEllipseAfterAnOrbit) {
    const Orbit orbit = orbit_of(orbit_model("clohessy-wiltshire"));
    const double n = orbit.rate_rad_s(), quarter = 0.25 * period_s(orbit);
    // No drift along the orbit where y' = -2 n x: an ellipse twice as long as it is high.
    const Translation start = from_lvlh(orbit, {100, 0, 30}, {0, -200 * n, 0});
    Translation x = start;
    for (int i = 0; i < 1000; ++i) x = propagated(orbit, i * quarter / 1000, quarter / 1000, {}, x);
    expect_near(position_in_lvlh(orbit, quarter, x), {0, -200, 0}, 1e-8);
    expect_near(propagated(orbit, quarter, 3 * quarter, {}, x).position_m, start.position_m, 1e-8);
}

TEST(OrbitMotion, ClohessyWiltshireUnderThrustEqualsNumericalIntegration) {
    const Orbit orbit = orbit_of(orbit_model("clohessy-wiltshire"));
    const double n = orbit.rate_rad_s(), dt_s = 600;
    const Vec3 push{1e-3, -2e-3, 5e-4};
    // In LVLH axes, which is where it is constant: given as it is in the middle of the time.
    const Translation x = propagated(orbit, 0, dt_s, orbit.q_world_frame(dt_s / 2) * push,
                                     from_lvlh(orbit, {10, -20, 30}, {0.1, 0.2, -0.3}));
    Vec3 r{10, -20, 30}, v{0.1, 0.2, -0.3};
    const auto acceleration = [&](const Vec3& p, const Vec3& u) {
        return Vec3{3 * n * n * p.x + 2 * n * u.y, -2 * n * u.x, -n * n * p.z} + push;
    };
    const double h = 0.1;
    for (int i = 0; i < 6000; ++i) {
        const Vec3 a1 = acceleration(r, v), v2 = v + h / 2 * a1, a2 = acceleration(r + h / 2 * v, v2);
        const Vec3 v3 = v + h / 2 * a2, a3 = acceleration(r + h / 2 * v2, v3);
        const Vec3 v4 = v + h * a3, a4 = acceleration(r + h * v3, v4);
        r += h / 6 * (v + 2.0 * v2 + 2.0 * v3 + v4);
        v += h / 6 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    expect_near(position_in_lvlh(orbit, dt_s, x), r, 1e-9);
}

TEST(OrbitMotion, TwoBodyOrbitClosesAndKeepsEnergyAndMomentum) {
    const Orbit orbit = orbit_of(orbit_model("two-body"));
    const double R = orbit.radius_m, mu = orbit.mu_m3_s2;
    // An ellipse with the same major axis comes back when the target does: at the same radius, as fast, but
    // steeper.
    const double v = std::sqrt(mu / R), tilt = 1e-4;
    const Quat q = orbit.q_world_frame(0);
    const auto absolute = [&](double t_s, const Translation& x) {
        const Quat now = orbit.q_world_frame(t_s);
        return Translation{now * Vec3{R, 0, 0} + x.position_m, now * Vec3{0, v, 0} + x.velocity_m_s};
    };
    const Translation start{{}, q * Vec3{v * std::sin(tilt), v * (std::cos(tilt) - 1), 0}};
    const auto energy = [&](const Translation& a) {
        return 0.5 * dot(a.velocity_m_s, a.velocity_m_s) - mu / norm(a.position_m);
    };
    const Translation a0 = absolute(0, start);
    Translation x = start;
    const double step_s = period_s(orbit) / 64;
    double farthest_m = 0;
    for (int i = 0; i < 64; ++i) {
        x = propagated(orbit, i * step_s, step_s, {}, x);
        farthest_m = std::max(farthest_m, norm(x.position_m));
        const Translation a = absolute((i + 1) * step_s, x);
        EXPECT_NEAR(energy(a) / energy(a0), 1, 1e-13);
        const Vec3 momentum = cross(a.position_m, a.velocity_m_s),
                   momentum0 = cross(a0.position_m, a0.velocity_m_s);
        EXPECT_NEAR(norm(momentum - momentum0) / norm(momentum0), 0, 1e-13);
    }
    EXPECT_GT(farthest_m, 1000);
    expect_near(x.position_m, {}, 1e-6);
    expect_near(x.velocity_m_s, start.velocity_m_s, 1e-9);
}

TEST(OrbitMotion, TwoBodyMotionKeepsMetresExactAtTheOrbitsRadius) {
    const Orbit orbit = orbit_of(orbit_model("two-body"));
    // On the target's own circle a metre ahead it stays a metre ahead: an arc of 1 / R.
    const double R = orbit.radius_m, n = orbit.rate_rad_s(), arc = 1 / R;
    const double back = 2 * R * std::sin(arc / 2) * std::sin(arc / 2);  // R (1 - cos)
    const Vec3 position{-back, R * std::sin(arc), 0};
    const Translation start = from_lvlh(orbit, position, {});
    const double t_s = period_s(orbit) / 3;
    const Translation x = propagated(orbit, 0, t_s, {}, start);
    expect_near(position_in_lvlh(orbit, t_s, x), position, 1e-10);
    EXPECT_NEAR(norm(x.velocity_m_s), n, 1e-13);
}

TEST(OrbitMotion, ClohessyWiltshireDiffersFromTwoBodiesByTheSquareOfTheDistance) {
    const Orbit linear = orbit_of(orbit_model("clohessy-wiltshire")), full = orbit_of(orbit_model("two-body"));
    const auto difference_m = [&](double distance_m) {
        const Translation start = from_lvlh(full, {0.6 * distance_m, -0.8 * distance_m, 0.3 * distance_m}, {});
        return norm(propagated(full, 0, 900, {}, start).position_m -
                    propagated(linear, 0, 900, {}, start).position_m);
    };
    const double near_m = difference_m(100), far_m = difference_m(1000);
    EXPECT_GT(near_m, 1e-6);
    EXPECT_NEAR(far_m / near_m, 100, 1);
}

TEST(OrbitMotion, TheAttractorsVelocityIsItsRateOfChange) {
    const Orbit orbit = orbit_of(orbit_model("two-body"));
    const Motion a = attractor_motion(orbit, {0, 1, 0, 0}, 99.5), b = attractor_motion(orbit, {0, 1, 0, 0}, 100.5);
    const Motion middle = attractor_motion(orbit, {0, 1, 0, 0}, 100);
    expect_near(b.T_world_body.t - a.T_world_body.t, middle.velocity_m_s, 1e-3);
    EXPECT_NEAR(norm(middle.T_world_body.t), orbit.radius_m, 1e-6);
    EXPECT_EQ(middle.T_world_body.q, (Quat{0, 1, 0, 0}));
}

struct Invariants {
    double energy_j;
    Vec3 momentum_world;
};
Invariants invariants(const Eigen::Matrix3d& J, const Attitude& a) {
    const Vec3 h = to_vec3(J * to_eigen(a.rate_rad_s));
    return {0.5 * dot(a.rate_rad_s, h), a.q_world_body * h};
}

TEST(RigidBody, ATumbleKeepsEnergyAndMomentum) {
    Eigen::Matrix3d J;
    J << 15e3, 2e3, -1e3, 2e3, 31e3, 500, -1e3, 500, 24e3;
    const RigidBody body(J);
    Attitude a{normalized(Quat{1, 2, 3, 4}), {0.05, -0.02, 0.03}};
    const Invariants before = invariants(J, a);
    for (int i = 0; i < 20'000; ++i) a = body.turned(a, {}, 0.05);  // ten turns
    const Invariants then = invariants(J, a);
    EXPECT_NEAR(then.energy_j / before.energy_j, 1, 1e-11);
    EXPECT_NEAR(norm(then.momentum_world - before.momentum_world) / norm(before.momentum_world), 0, 1e-10);
}

TEST(RigidBody, RotationAboutTheIntermediateAxisFlipsAndReturns) {
    // V. Dzhanibekov's wing nut: about the axis of the middle moment rotation is not stable.
    const Eigen::Matrix3d J = Eigen::Vector3d(1, 2, 3).asDiagonal();
    const RigidBody body(J);
    Attitude a{{}, {1e-3, 1, 0}};
    const Invariants before = invariants(J, a);
    double least = 1, max_after = -1;
    for (int i = 0; i < 60'000; ++i) {
        a = body.turned(a, {}, 1e-3);
        least = std::min(least, a.rate_rad_s.y);
        if (least < -0.999) max_after = std::max(max_after, a.rate_rad_s.y);
    }
    EXPECT_LT(least, -0.999);
    EXPECT_GT(max_after, 0.999);
    EXPECT_NEAR(invariants(J, a).energy_j / before.energy_j, 1, 1e-10);
}

TEST(RigidBody, TorqueChangesMomentumByTorqueTimesTime) {
    const Eigen::Matrix3d J = Eigen::Vector3d(15e3, 31e3, 30e3).asDiagonal();
    const Attitude a = RigidBody(J).turned({}, {0, 400, 0}, 0.5);
    EXPECT_NEAR(a.rate_rad_s.y, 400 * 0.5 / 31e3, 1e-15);
    EXPECT_NEAR(rotation_vector(a.q_world_body).y, 0.5 * 400 / 31e3 * 0.25, 1e-15);
}

TEST(TargetMotion, WithLvlhItRotatesAtTheOrbitsRatePlusItsOwn) {
    Scenario s = quiet(orbit_model("two-body"));
    s.target_motion = {true, {0, 0.5, 0}};
    s.q_world_target = normalized(Quat{1, 0.2, -0.3, 0.4});
    Simulation simulation = simulate(s);
    simulation.advance_to(ns(100));
    const Quat q_lvlh_body0 = conjugate(s.orbit.q_world_frame(0)) * s.q_world_target;
    const Quat expected = s.orbit.q_world_frame(100) * q_lvlh_body0 * exp_rotation({0, 50 * kRadPerDeg, 0});
    EXPECT_NEAR(angle_between(simulation.truth().target.T_world_body.q, expected), 0, 1e-12);
    // The centre of mass is the world's origin all the time.
    expect_near(simulation.truth().target.T_world_body * s.target.centre_of_mass_m, {}, 1e-12);
}

TEST(TargetMotion, WithoutLvlhItTumbles) {
    Scenario s = quiet(orbit_model("two-body"));
    s.target_motion = {false, {0.5, 1, -0.2}};
    Simulation simulation = simulate(s);
    const Attitude start{s.q_world_target, kRadPerDeg * s.target_motion.rate_deg_s};
    simulation.advance_to(ns(100));
    const Attitude expected = RigidBody(s.target.inertia_kg_m2).turned(start, {}, 100);
    EXPECT_NEAR(angle_between(simulation.truth().target.T_world_body.q, expected.q_world_body), 0, 1e-9);
    expect_near(simulation.truth().target.rate_rad_s, expected.rate_rad_s, 1e-12);
}

TEST(TargetMotion, VelocitiesAreRatesOfChangeOfTheOrigins) {
    Scenario s = quiet(orbit_model("two-body"));
    s.target_motion = {false, {0.5, 1, -0.2}};
    s.start.rate_deg_s = {1, -2, 3};
    s.start.velocity_m_s = {-0.1, 0.02, 0.05};
    Simulation simulation = simulate(s);
    const double h = 0.01;
    simulation.advance_to(ns(10 - h));
    const Truth a = simulation.truth();
    simulation.advance_to(ns(10));
    const Truth middle = simulation.truth();
    simulation.advance_to(ns(10 + h));
    const Truth b = simulation.truth();
    expect_near((b.target.T_world_body.t - a.target.T_world_body.t) / (2 * h), middle.target.velocity_m_s, 1e-6);
    expect_near((b.chaser.T_world_body.t - a.chaser.T_world_body.t) / (2 * h), middle.chaser.velocity_m_s, 1e-6);
    expect_near(rotation_vector(conjugate(a.chaser.T_world_body.q) * b.chaser.T_world_body.q) / (2 * h),
                middle.chaser.rate_rad_s, 1e-6);
}

}  // namespace
}  // namespace narpa::rehearsal
