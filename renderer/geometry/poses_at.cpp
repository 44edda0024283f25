#include "renderer/geometry/poses_at.h"

#include "base/each_isa.h"

namespace narpa {
namespace {

NARPA_EACH_ISA void go_straight(const Vec3& start, const Vec3& end, const Lanes<double>& time,
                                Vec3Lanes& __restrict position) {
    const Vec3 way = end - start;
    for (std::size_t i = 0; i < kLanes; ++i) position.put(i, choose(time[i] == 1, end, start + time[i] * way));
}

/// Attitudes, without branches.
NARPA_EACH_ISA void turn_about_axis(const PosePath& path, const Lanes<double>& time, PoseLanes& __restrict T) {
    const Quat start = path.start().q, near = path.near_end(), end = path.end().q;
    Lanes<double> ka, kb;
    ka.fill(1), kb.fill(1);
    for (int n = path.terms(); n > 0; --n) {
        const double c = path.coefficient(n), n2 = n * n;
        for (std::size_t i = 0; i < kLanes; ++i) {
            const double u = time[i], v = 1 - u;
            ka[i] = 1 + c * (n2 - v * v) * ka[i];
            kb[i] = 1 + c * (n2 - u * u) * kb[i];
        }
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double u = time[i], a = (1 - u) * ka[i], b = u * kb[i];
        const Quat q = normalized(Quat{a * start.w + b * near.w, a * start.x + b * near.x, a * start.y + b * near.y,
                                       a * start.z + b * near.z});
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
    go_straight(at.path(body).start().t, at.path(body).end().t, time, position);
}

void poses_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, PoseLanes& T_world_body) noexcept {
    if (!at.moves(body)) return T_world_body.fill(at.T_world_body[body]);
    poses_at(at.path(body), time, T_world_body);
}

void poses_at(const PosePath& path, const Lanes<double>& time, PoseLanes& T) noexcept {
    if (!path.moves()) return T.fill(path.start());
    go_straight(path.start().t, path.end().t, time, T.t);
    turn_about_axis(path, time, T);
}

}  // namespace narpa
