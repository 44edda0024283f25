/// apps/tracker_options.h - how poses are estimated: options of `estimate` and of `run --estimate`.
#pragma once

#include <string>

#include "apps/cli.h"
#include "emulator/frame_tracker.h"

namespace narpa::cli {

struct TrackerFlags {
    std::string method = "features";
    std::string start = "2,2";
    TrackerOptions tracker;

    /// With `prefix` before each name: --target, or --estimate-target.
    void add_to(Parser app, const std::string& prefix);
    [[nodiscard]] Result<TrackerOptions> options() const;
};

}  // namespace narpa::cli
