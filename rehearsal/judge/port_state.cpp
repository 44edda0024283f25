#include "rehearsal/judge/port_state.h"

#include <algorithm>
#include <cmath>

namespace narpa::rehearsal {
namespace {

/// Pose and velocity of a point that is fixed in a body.
struct Point {
    Rigid3 T_world_port;
    Vec3 velocity_m_s, rate_world_rad_s;
};

Point port_of(const Motion& body, const Vehicle& vehicle) {
    const Vec3 rate = body.T_world_body.q * body.rate_rad_s;
    const Vec3 arm = body.T_world_body.q * vehicle.T_body_port.t;
    return {body.T_world_body * vehicle.T_body_port, body.velocity_m_s + cross(rate, arm), rate};
}

Vec3 off_docked(const Quat& q_port_port) {
    return rotation_vector(conjugate(T_port_docked().q) * q_port_port);
}

}  // namespace

double PortState::lateral_m() const {
    return std::hypot(position_m.y, position_m.z);
}
double PortState::closing_m_s() const {
    return -velocity_m_s.x;
}
double PortState::lateral_m_s() const {
    return std::hypot(velocity_m_s.y, velocity_m_s.z);
}
// Swing and twist: q = swing * twist about x, so that the swing is what the axes are apart.
double PortState::pitch_yaw_rad() const {
    const Quat q = exp_rotation(rotation_rad);
    return 2 * std::atan2(std::hypot(q.y, q.z), std::hypot(q.w, q.x));
}
double PortState::roll_rad() const {
    const Quat q = exp_rotation(rotation_rad);
    return 2 * std::atan2(std::abs(q.x), std::abs(q.w));
}
double PortState::pitch_yaw_rad_s() const {
    return std::hypot(rate_rad_s.y, rate_rad_s.z);
}
double PortState::roll_rad_s() const {
    return std::abs(rate_rad_s.x);
}

PortState port_state(const Scenario& scenario, std::int64_t t_ns, const Motion& target, const Motion& chaser) {
    const Point to = port_of(target, scenario.target), from = port_of(chaser, scenario.chaser);
    const Rigid3 T = inverse(to.T_world_port) * from.T_world_port;
    const Vec3 apart = from.T_world_port.t - to.T_world_port.t;
    const Vec3 velocity = from.velocity_m_s - to.velocity_m_s - cross(to.rate_world_rad_s, apart);
    const Vec3 rate = from.rate_world_rad_s - to.rate_world_rad_s;
    return {t_ns, T.t, conjugate(to.T_world_port.q) * velocity, off_docked(T.q),
            conjugate(from.T_world_port.q) * rate};
}

Rigid3 T_port_port(const Scenario& scenario, const Rigid3& T_chaser_target) {
    return inverse(T_chaser_target * scenario.target.T_body_port) * scenario.chaser.T_body_port;
}

bool MotionTrack::push(std::int64_t t_ns, const Motion& motion) {
    if (!samples_.empty() && t_ns <= samples_.back().t_ns) return false;
    samples_.push_back({t_ns, motion});
    return true;
}

std::optional<Motion> MotionTrack::at(std::int64_t t_ns) const {
    const auto after = std::lower_bound(samples_.begin(), samples_.end(), t_ns,
                                        [](const Sample& s, std::int64_t t) { return s.t_ns < t; });
    if (after == samples_.end()) return std::nullopt;
    if (after->t_ns == t_ns) return after->motion;
    if (after == samples_.begin()) return std::nullopt;
    const auto& [ta, a] = *std::prev(after);
    const auto& [tb, b] = *after;
    const double h = static_cast<double>(tb - ta) * 1e-9, u = static_cast<double>(t_ns - ta) * 1e-9 / h;
    const Vec3 pa = a.T_world_body.t, pb = b.T_world_body.t, va = a.velocity_m_s, vb = b.velocity_m_s;
    // Hermite: what is added to the straight line vanishes at both ends.
    const Vec3 line = (pb - pa) / h, bend_a = va - line, bend_b = vb - line;
    Motion m;
    m.T_world_body.t = pa + (pb - pa) * u + (bend_a * ((1 - u) * (1 - u) * u) + bend_b * ((u - 1) * u * u)) * h;
    m.velocity_m_s = line + bend_a * ((1 - u) * (1 - 3 * u)) + bend_b * (u * (3 * u - 2));
    m.T_world_body.q = slerp(a.T_world_body.q, b.T_world_body.q, u);
    m.rate_rad_s = a.rate_rad_s + (b.rate_rad_s - a.rate_rad_s) * u;
    return m;
}

}  // namespace narpa::rehearsal
