/// rehearsal/judge/motion_track.h - a body's commanded motion over time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/pose.h"

namespace narpa::rehearsal {

class MotionTrack {
public:
    /// False: not newer than the last one, and not taken.
    bool push(std::int64_t t_ns, const Motion& motion);
    /// Exact at the times of commands; between them a cubic through positions and velocities, the shortest arc
    /// between attitudes. Nothing before the first and after the last.
    [[nodiscard]] std::optional<Motion> at(std::int64_t t_ns) const;
    [[nodiscard]] bool empty() const { return samples_.empty(); }
    [[nodiscard]] std::int64_t newest_ns() const { return samples_.back().t_ns; }
    [[nodiscard]] std::size_t size() const { return samples_.size(); }

private:
    struct Sample {
        std::int64_t t_ns;
        Motion motion;
    };
    std::vector<Sample> samples_;
};

}  // namespace narpa::rehearsal
