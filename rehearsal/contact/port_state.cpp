#include "rehearsal/contact/port_state.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {
namespace {

Quat q_docked_chaser_port(const PortState& s) {
    return conjugate(T_port_docked().q) * s.T_port_chaser_port.q;
}

/// Angular rate in world axes.
Vec3 rate_world(const Motion& m) {
    return m.T_world_body.q * m.rate_rad_s;
}

}  // namespace

double PortState::lateral_m() const {
    return std::hypot(position_m().y, position_m().z);
}
double PortState::closing_m_s() const {
    return -velocity_m_s.x;
}
double PortState::lateral_m_s() const {
    return std::hypot(velocity_m_s.y, velocity_m_s.z);
}

Vec3 PortState::misalignment_rad() const {
    return rotation_vector(q_docked_chaser_port(*this));
}
// q = swing * twist about x.
double PortState::pitch_yaw_rad() const {
    const Quat q = q_docked_chaser_port(*this);
    return 2 * std::atan2(std::hypot(q.y, q.z), std::hypot(q.w, q.x));
}
double PortState::roll_rad() const {
    const Quat q = q_docked_chaser_port(*this);
    return 2 * std::atan2(std::abs(q.x), std::abs(q.w));
}
double PortState::pitch_yaw_rad_s() const {
    return std::hypot(rate_rad_s.y, rate_rad_s.z);
}
double PortState::roll_rad_s() const {
    return std::abs(rate_rad_s.x);
}

Motion fixed_to(const Motion& body, const Rigid3& T_body_axes) {
    return {body.T_world_body * T_body_axes,
            body.velocity_m_s + body.T_world_body.q * cross(body.rate_rad_s, T_body_axes.t),
            conjugate(T_body_axes.q) * body.rate_rad_s};
}

PortState port_state(const Motion& target_port, const Motion& chaser_port) {
    const Rigid3 &T_world_target = target_port.T_world_body, &T_world_chaser = chaser_port.T_world_body;
    const Vec3 target_rate = rate_world(target_port);
    const Vec3 velocity = chaser_port.velocity_m_s - target_port.velocity_m_s -
                          cross(target_rate, T_world_chaser.t - T_world_target.t);
    return {inverse(T_world_target) * T_world_chaser, conjugate(T_world_target.q) * velocity,
            chaser_port.rate_rad_s - conjugate(T_world_chaser.q) * target_rate};
}

Motion chaser_port_motion(const PortState& state, const Motion& target_port) {
    const Rigid3 T_world_chaser = target_port.T_world_body * state.T_port_chaser_port;
    const Vec3 target_rate = rate_world(target_port);
    return {T_world_chaser,
            target_port.velocity_m_s + cross(target_rate, T_world_chaser.t - target_port.T_world_body.t) +
                target_port.T_world_body.q * state.velocity_m_s,
            state.rate_rad_s + conjugate(T_world_chaser.q) * target_rate};
}

PortState port_state(const Vehicle& target, const Motion& target_body, const Vehicle& chaser,
                     const Motion& chaser_body) {
    return port_state(fixed_to(target_body, target.T_body_port), fixed_to(chaser_body, chaser.T_body_port));
}

Motion chaser_motion(const PortState& state, const Vehicle& target, const Motion& target_body,
                     const Vehicle& chaser) {
    Motion body =
        fixed_to(chaser_port_motion(state, fixed_to(target_body, target.T_body_port)), inverse(chaser.T_body_port));
    body.T_world_body.q = normalized(body.T_world_body.q);
    return body;
}

ContactConditions contact_conditions(const CaptureEnvelope& limits, const PortState& s) {
    return {
        {"closing_rate", "closing rate", "m/s", s.closing_m_s(), limits.closing_min_m_s, limits.closing_max_m_s},
        {"lateral_rate", "lateral rate", "m/s", s.lateral_m_s(), 0, limits.lateral_rate_m_s},
        {"lateral", "lateral misalignment", "m", s.lateral_m(), 0, limits.lateral_m},
        {"pitch_yaw", "pitch and yaw", "deg", s.pitch_yaw_rad() * kDegPerRad, 0, limits.pitch_yaw_deg},
        {"roll", "roll", "deg", s.roll_rad() * kDegPerRad, 0, limits.roll_deg},
        {"pitch_yaw_rate", "pitch and yaw rate", "deg/s", s.pitch_yaw_rad_s() * kDegPerRad, 0,
         limits.pitch_yaw_rate_deg_s},
        {"roll_rate", "roll rate", "deg/s", s.roll_rad_s() * kDegPerRad, 0, limits.roll_rate_deg_s},
    };
}

bool within(const CaptureEnvelope& limits, const PortState& state) {
    const ContactConditions conditions = contact_conditions(limits, state);
    return std::all_of(conditions.begin(), conditions.end(), [](const ContactCondition& c) { return c.within(); });
}

}  // namespace narpa::rehearsal
