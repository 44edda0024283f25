#include "rehearsal/dynamics/port_motion.h"

#include <cmath>

#include "rehearsal/dynamics/random_streams.h"

namespace narpa::rehearsal {
namespace {

/// Of a point fixed to a body, world axes.
Vec3 velocity_at(const Motion& body, const Vec3& point_body_m) {
    return body.velocity_m_s + body.T_world_body.q * cross(body.rate_rad_s, point_body_m);
}

}  // namespace

PortMotion port_motion(const Vehicle& target, const Motion& t, const Vehicle& chaser, const Motion& c) {
    const Rigid3 T_world_target_port = t.T_world_body * target.T_body_port;
    const Rigid3 T_world_chaser_port = c.T_world_body * chaser.T_body_port;
    const Quat q_port_world = conjugate(T_world_target_port.q);
    const Quat q_world_docked = T_world_target_port.q * T_port_docked().q;

    PortMotion port;
    port.position_m = q_port_world * (T_world_chaser_port.t - T_world_target_port.t);
    // Against the point of the target that is there now.
    const Vec3 there_body_m = inverse(t.T_world_body) * T_world_chaser_port.t;
    port.velocity_m_s = q_port_world * (velocity_at(c, chaser.T_body_port.t) - velocity_at(t, there_body_m));
    port.attitude_rad = rotation_vector(conjugate(q_world_docked) * T_world_chaser_port.q);
    const Vec3 rate_world = c.T_world_body.q * c.rate_rad_s - t.T_world_body.q * t.rate_rad_s;
    port.rate_rad_s = conjugate(T_world_chaser_port.q) * rate_world;
    return port;
}

Motion chaser_motion(const PortMotion& port, const Vehicle& target, const Motion& t, const Vehicle& chaser) {
    const Rigid3 T_world_target_port = t.T_world_body * target.T_body_port;
    const Rigid3 T_world_chaser_port{T_world_target_port.q * T_port_docked().q * exp_rotation(port.attitude_rad),
                                     T_world_target_port * port.position_m};
    Motion c;
    c.T_world_body = T_world_chaser_port * inverse(chaser.T_body_port);
    c.T_world_body.q = normalized(c.T_world_body.q);
    const Vec3 rate_world = T_world_chaser_port.q * port.rate_rad_s + t.T_world_body.q * t.rate_rad_s;
    c.rate_rad_s = conjugate(c.T_world_body.q) * rate_world;
    const Vec3 there_body_m = inverse(t.T_world_body) * T_world_chaser_port.t;
    c.velocity_m_s = velocity_at(t, there_body_m) + T_world_target_port.q * port.velocity_m_s -
                     c.T_world_body.q * cross(c.rate_rad_s, chaser.T_body_port.t);
    return c;
}

bool within(const Gates::Contact& e, const PortMotion& p) {
    const double closing = -p.velocity_m_s.x;
    return closing >= e.closing_min_m_s && closing <= e.closing_max_m_s &&
           std::hypot(p.velocity_m_s.y, p.velocity_m_s.z) <= e.lateral_rate_m_s &&
           std::hypot(p.position_m.y, p.position_m.z) <= e.lateral_m &&
           std::hypot(p.attitude_rad.y, p.attitude_rad.z) <= e.pitch_yaw_deg * kRadPerDeg &&
           std::abs(p.attitude_rad.x) <= e.roll_deg * kRadPerDeg &&
           std::hypot(p.rate_rad_s.y, p.rate_rad_s.z) <= e.pitch_yaw_rate_deg_s * kRadPerDeg &&
           std::abs(p.rate_rad_s.x) <= e.roll_rate_deg_s * kRadPerDeg;
}

}  // namespace narpa::rehearsal
