#include "renderer/geometry/poses_at.h"

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr double kShortChord2 = 1e-6;  ///< squared chord up to which slerp uses its series

NARPA_EACH_ISA void go_straight(const Vec3& start, const Vec3& end, const Lanes<double>& time,
                                Vec3Lanes& __restrict position) {
    const Vec3 way = end - start;
    for (std::size_t i = 0; i < kLanes; ++i) position.put(i, choose(time[i] == 1, end, start + time[i] * way));
}

/// Slerp without branches; `near` is `end` with the sign that is nearer to `start`.
NARPA_EACH_ISA void turn_slightly(const Quat& start, const Quat& near, const Quat& end, double chord2,
                                  const Lanes<double>& time, PoseLanes& __restrict T) {
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double u = time[i], v = 1 - u;
        const double ka = v * (1 + chord2 / 6 * (1 - v * v)), kb = u * (1 + chord2 / 6 * (1 - u * u));
        const Quat q = normalized(Quat{ka * start.w + kb * near.w, ka * start.x + kb * near.x,
                                       ka * start.y + kb * near.y, ka * start.z + kb * near.z});
        const bool first = u == 0, last = u == 1;
        T.w[i] = choose(first, start.w, choose(last, end.w, q.w));
        T.x[i] = choose(first, start.x, choose(last, end.x, q.x));
        T.y[i] = choose(first, start.y, choose(last, end.y, q.y));
        T.z[i] = choose(first, start.z, choose(last, end.z, q.z));
    }
}

}  // namespace

void positions_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, Vec3Lanes& position) noexcept {
    if (!at.moves(body)) return position.fill(at.T_world_body[body].t);
    go_straight(at.position_at(body, 0), at.position_at(body, 1), time, position);
}

void poses_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, PoseLanes& T_world_body) noexcept {
    if (!at.moves(body)) return T_world_body.fill(at.T_world_body[body]);
    const Rigid3 start = at.T_world_body_at(body, 0), end = at.T_world_body_at(body, 1);
    const Quat near = dot(start.q, end.q) < 0 ? -end.q : end.q;
    const Quat chord{near.w - start.q.w, near.x - start.q.x, near.y - start.q.y, near.z - start.q.z};
    if (const double chord2 = dot(chord, chord); chord2 < kShortChord2) {
        go_straight(start.t, end.t, time, T_world_body.t);
        turn_slightly(start.q, near, end.q, chord2, time, T_world_body);
    } else {
        for (std::size_t i = 0; i < kLanes; ++i) T_world_body.put(i, at.T_world_body_at(body, time[i]));
    }
}

}  // namespace narpa
