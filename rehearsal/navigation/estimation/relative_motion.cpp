#include "rehearsal/navigation/estimation/relative_motion.h"

#include <cmath>

namespace narpa::rehearsal {
namespace {

Motion target_port(const RelativeMotion& m, const Vehicle& target) {
    return fixed_to({{m.q_world_target, {}}, {}, m.target_rate_rad_s}, port_from_mass(target));
}

/// Motion of the body axes at the centre of mass.
Motion chaser_mass(const RelativeMotion& m) {
    return {{m.q_world_chaser, m.position_m}, m.velocity_m_s, m.chaser_rate_rad_s};
}

}  // namespace

Rigid3 port_from_mass(const Vehicle& vehicle) {
    return {vehicle.T_body_port.q, vehicle.T_body_port.t - vehicle.centre_of_mass_m};
}

RelativeMotion in_world(const RelativeState& state, const Orbit& orbit, double t_s, const Quat& q_world_chaser,
                        const Vec3& chaser_rate_rad_s) {
    const Quat q_world_frame = orbit.q_world_frame(t_s);
    const Vec3 frame_rate{0, 0, orbit.rate_rad_s()};
    RelativeMotion out;
    out.position_m = -(q_world_frame * state.position_m);
    out.velocity_m_s = -(q_world_frame * (state.velocity_m_s + cross(frame_rate, state.position_m)));
    out.q_world_target = normalized(q_world_frame * state.q_frame_target);
    out.q_world_chaser = q_world_chaser;
    out.target_rate_rad_s = state.rate_rad_s;
    out.chaser_rate_rad_s = chaser_rate_rad_s;
    return out;
}

RelativeState in_frame(const RelativeMotion& motion, const Orbit& orbit, double t_s) {
    const Quat q_frame_world = conjugate(orbit.q_world_frame(t_s));
    const Vec3 frame_rate{0, 0, orbit.rate_rad_s()};
    RelativeState out;
    out.position_m = -(q_frame_world * motion.position_m);
    out.velocity_m_s = -(q_frame_world * motion.velocity_m_s) - cross(frame_rate, out.position_m);
    out.q_frame_target = normalized(q_frame_world * motion.q_world_target);
    out.rate_rad_s = motion.target_rate_rad_s;
    return out;
}

PortState port_state(const RelativeMotion& m, const Vehicle& target, const Vehicle& chaser) {
    return port_state(target_port(m, target), fixed_to(chaser_mass(m), port_from_mass(chaser)));
}

void place_port(const Vec3& port_m, const Vec3& port_velocity_m_s, const Vehicle& target, const Vehicle& chaser,
                RelativeMotion& m) {
    PortState port = port_state(m, target, chaser);
    port.T_port_chaser_port.t = port_m;
    port.velocity_m_s = port_velocity_m_s;
    const Motion mass = fixed_to(chaser_port_motion(port, target_port(m, target)), inverse(port_from_mass(chaser)));
    m.position_m = mass.T_world_body.t;
    m.velocity_m_s = mass.velocity_m_s;
}

Vec3 nominal_target_rate_rad_s(const Scenario& scenario) {
    const Vec3 rate = kDegree * scenario.target_motion.rate_deg_s;
    if (!scenario.target_motion.with_lvlh) return rate;
    const Vec3 orbital = scenario.orbit.q_world_frame(0) * Vec3{0, 0, scenario.orbit.rate_rad_s()};
    return rate + conjugate(scenario.q_world_target) * orbital;
}

GroundField ground_field(const Orbit& orbit) {
    const Vec3 axis{0, 0, 1}, rate = orbit.rotation_rad_s * axis;
    const Vec3 out = conjugate(orbit.q_world_frame(0)) * normalized(orbit.up), ground = orbit.radius_m * out;
    GroundField field{orbit.gravity_m_s2(ground, axis) - cross(rate, cross(rate, ground)), {}};
    const Eigen::Vector3d u = to_eigen(out);
    const Eigen::Matrix3d turn = skew(to_eigen(rate));
    field.gradient_s2 =
        orbit.mu_m3_s2 / std::pow(orbit.radius_m, 3) * (3 * u * u.transpose() - Eigen::Matrix3d::Identity()) -
        turn * turn;
    return field;
}

Vec3 gravity_difference_m_s2(const Orbit& orbit, double t_s, const Vec3& position_m) {
    if (orbit.model->over_ground) return orbit.relative_free_fall_m_s2(t_s, position_m);
    const double n = orbit.rate_rad_s();
    const Vec3 up = orbit.q_world_frame(t_s) * Vec3{1, 0, 0};
    return n * n * (3 * dot(position_m, up) * up - position_m);
}

}  // namespace narpa::rehearsal
