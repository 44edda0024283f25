#include "rehearsal/navigation/attitude_track.h"

#include <algorithm>

namespace narpa::rehearsal {

bool AttitudeTrack::take(const AttitudeReport& report) noexcept {
    if (count_ > 0 && report.t_ns <= newest().t_ns) return false;
    if (count_ == reports_.size()) {
        std::move(reports_.begin() + 1, reports_.end(), reports_.begin());
        --count_;
    }
    reports_[count_++] = report;
    return true;
}

AttitudeTrack::At AttitudeTrack::at(std::int64_t t_ns) const noexcept {
    std::size_t after = 0;
    while (after < count_ && reports_[after].t_ns < t_ns) ++after;
    if (after > 0 && after < count_) {
        const AttitudeReport &a = reports_[after - 1], &b = reports_[after];
        const double u = static_cast<double>(t_ns - a.t_ns) / static_cast<double>(b.t_ns - a.t_ns);
        return {slerp(a.q_world_chaser, b.q_world_chaser, u), (1 - u) * a.rate_rad_s + u * b.rate_rad_s};
    }
    const AttitudeReport& nearest = reports_[after == 0 ? 0 : count_ - 1];
    const double off_s = 1e-9 * static_cast<double>(t_ns - nearest.t_ns);
    return {normalized(nearest.q_world_chaser * exp_rotation(off_s * nearest.rate_rad_s)), nearest.rate_rad_s};
}

}  // namespace narpa::rehearsal
