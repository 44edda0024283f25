#include "rehearsal/judge/motion_track.h"

#include <algorithm>

namespace narpa::rehearsal {

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
