#include "renderer/geometry/body_poses.h"

#include <algorithm>

namespace narpa {

void BodyPoses::set(std::size_t body, std::span<const Rigid3> path) noexcept {
    set(body, path.front());
    const std::size_t n = std::min(path.size(), knots_);
    if (std::all_of(path.begin(), path.end(), [&](const Rigid3& T) { return T == path.front(); })) return;
    std::copy_n(path.begin(), n, path_.begin() + static_cast<std::ptrdiff_t>(body * knots_));
    path_size_[body] = n;
    ++moving_;
    T_world_body[body] = pose_on_path(body, 0.5);
}

BodyPoses::Segment BodyPoses::segment(std::size_t body, double time) const noexcept {
    const std::size_t last = path_size_[body] - 1;
    const double along = std::clamp(time, 0.0, 1.0) * static_cast<double>(last);
    const std::size_t k = std::min(static_cast<std::size_t>(along), last - 1);
    const Rigid3& start = path_[body * knots_ + k];
    return {start, *(&start + 1), along - static_cast<double>(k)};
}

Vec3 BodyPoses::position_on_path(std::size_t body, double time) const noexcept {
    const Segment s = segment(body, time);
    return s.part == 1 ? s.end.t : s.start.t + s.part * (s.end.t - s.start.t);
}

Rigid3 BodyPoses::pose_on_path(std::size_t body, double time) const noexcept {
    const Segment s = segment(body, time);
    const Quat q = s.part == 0 ? s.start.q : s.part == 1 ? s.end.q : slerp(s.start.q, s.end.q, s.part);
    return {q, position_on_path(body, time)};
}

}  // namespace narpa
