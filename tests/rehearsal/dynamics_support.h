// tests/rehearsal/dynamics_support.h - scenarios made in code.
#pragma once

#include <gtest/gtest.h>

#include "rehearsal/dynamics/simulation.h"
#include "rehearsal/dynamics/thruster_model.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Two craft that face each other 60 m apart; nothing is drawn, nothing disturbs. The ports are off the centres of
/// mass, and those off the bodies' origins.
inline Scenario quiet(const OrbitModel* model = orbit_model("free")) {
    Scenario s;
    s.name = "quiet";
    s.orbit.model = model;
    s.target.body = "target";
    s.target.can_id = 0x110;
    s.target.centre_of_mass_m = {-2, 0.1, 0.2};
    s.target.T_body_port = {{}, {3, 0, 0.5}};
    s.target.mass_kg = 100'000;
    s.target.inertia_kg_m2 = Eigen::Vector3d(2e6, 3e6, 4e6).asDiagonal();
    s.target_motion.with_lvlh = false;
    s.chaser.body = "chaser";
    s.chaser.can_id = 0x100;
    s.chaser.centre_of_mass_m = {-0.5, 0, 0.1};
    s.chaser.T_body_port = {{}, {2, 0, 0}};
    s.chaser.mass_kg = 10'000;
    s.chaser.inertia_kg_m2 = Eigen::Vector3d(15e3, 31e3, 30e3).asDiagonal();
    s.thrusters.gain_sigma = s.thrusters.misalignment_sigma_deg = 0;
    s.attitude_sensor = {0, 0};
    return s;
}

inline Simulation simulate(const Scenario& scenario, std::uint64_t seed = 1) {
    return {scenario, seed};
}

inline std::int64_t ns(double t_s) {
    return to_ns(t_s);
}

inline void expect_near(const Vec3& a, const Vec3& b, double within) {
    EXPECT_NEAR(norm(a - b), 0, within)
        << "(" << a.x << ", " << a.y << ", " << a.z << ") is not (" << b.x << ", " << b.y << ", " << b.z << ")";
}

}  // namespace narpa::rehearsal
