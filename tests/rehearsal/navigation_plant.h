/// tests/rehearsal/navigation_plant.h - a chaser under thrust beside a target on a circular orbit, for closed loops
/// without a bus: linear gravity, rigid chaser, pulses at full force from the beginning of each period.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "rehearsal/navigation/guidance/flight_control.h"
#include "tests/support/paths.h"

namespace narpa::rehearsal {

/// The docking that comes with narpa; read once.
inline const Scenario& docking_scenario() {
    static const Scenario scenario = [] {
        auto s = read_scenario(test::build_path("scenes/rehearsal/docking.toml"));
        EXPECT_TRUE(s) << s.error().text();
        return *std::move(s);
    }();
    return scenario;
}

struct Plant {
    Scenario scenario;
    RelativeMotion motion{};
    double t_s = 0;

    /// The chaser's port at `port_m`, in the docked attitude turned by `off_rad` (chaser's body axes), at rest in
    /// the target's port axes.
    void stand(const Vec3& port_m, const Vec3& off_rad) {
        motion.q_world_target = scenario.q_world_target;
        motion.target_rate_rad_s = nominal_target_rate_rad_s(scenario);
        motion.q_world_chaser = motion.q_world_target * scenario.target.T_body_port.q * T_port_docked().q *
                                conjugate(scenario.chaser.T_body_port.q) * exp_rotation(off_rad);
        motion.chaser_rate_rad_s =
            conjugate(motion.q_world_chaser) * (motion.q_world_target * motion.target_rate_rad_s);
        place_port(port_m, {}, scenario.target, scenario.chaser, motion);
    }

    void fly(const Impulses& impulses, double for_s) {
        constexpr double kStep_s = 0.01;
        const int steps = static_cast<int>(std::lround(for_s / kStep_s));
        for (int i = 0; i < steps; ++i) {
            const auto part = [&](const Vec3& impulse, double strength) {
                Vec3 mean;
                for (int k = 0; k < 3; ++k) {
                    const double on_s = std::abs(impulse[k]) / strength - i * kStep_s;
                    mean[k] = std::copysign(strength, impulse[k]) * std::clamp(on_s / kStep_s, 0.0, 1.0);
                }
                return mean;
            };
            step(part(impulses.linear_n_s, scenario.thrusters.force_n),
                 part(impulses.angular_n_m_s, scenario.thrusters.torque_n_m), kStep_s);
        }
    }

    void step(const Vec3& force_n, const Vec3& torque_n_m, double dt) {
        const Eigen::Matrix3d& I = scenario.chaser.inertia_kg_m2;
        Vec3& w = motion.chaser_rate_rad_s;
        const Vec3 momentum = to_vec3(I * to_eigen(w));
        w = w + dt * to_vec3(I.inverse() * to_eigen(torque_n_m - cross(w, momentum)));
        const Vec3 a = (motion.q_world_chaser * force_n) / scenario.chaser.mass_kg +
                       gravity_difference_m_s2(scenario.orbit, t_s, motion.position_m);
        motion.velocity_m_s = motion.velocity_m_s + dt * a;
        motion.position_m = motion.position_m + dt * motion.velocity_m_s;
        motion.q_world_chaser = normalized(motion.q_world_chaser * exp_rotation(dt * w));
        motion.q_world_target = normalized(motion.q_world_target * exp_rotation(dt * motion.target_rate_rad_s));
        t_s += dt;
    }

    [[nodiscard]] PortState port() const { return port_state(motion, scenario.target, scenario.chaser); }
    /// Angle between the chaser's port and the docked attitude.
    [[nodiscard]] double off_docked_rad() const {
        return angle_between(port().T_port_chaser_port.q, T_port_docked().q);
    }
};

}  // namespace narpa::rehearsal
