/// rehearsal/navigation/attitude_track.h - the chaser's attitude, interpolated between the sensor's reports.
#pragma once

#include <array>
#include <cstddef>

#include "protocols/closed_loop.h"

namespace narpa::rehearsal {

class AttitudeTrack {
public:
    /// False: not newer than the last report, and dropped.
    bool take(const AttitudeReport& report) noexcept;
    [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
    [[nodiscard]] const AttitudeReport& newest() const noexcept { return reports_[count_ - 1]; }

    struct At {
        Quat q_world_chaser{};
        Vec3 rate_rad_s{};  ///< body axes, against inertial space
    };
    /// Between two reports along the shortest arc; outside them extrapolated at the nearest one's rate. Not when
    /// empty.
    [[nodiscard]] At at(std::int64_t t_ns) const noexcept;

private:
    std::array<AttitudeReport, 8> reports_{};  ///< oldest first
    std::size_t count_ = 0;
};

}  // namespace narpa::rehearsal
