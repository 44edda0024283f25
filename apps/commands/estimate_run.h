/// apps/commands/estimate_run.h - `narpa estimate RUN`: poses from the frames or sweeps of a logged run.
#pragma once

#include <string>
#include <vector>

#include "apps/cli.h"
#include "tracking/target_tracker.h"

namespace narpa::cli {

struct RunEstimate {
    std::string folder;        ///< with the run's log
    std::string sensor;        ///< name of a camera or LiDAR; empty: the first camera, else the first LiDAR
    std::string scene;         ///< in place of the run's; empty: the run's
    std::string csv, picture;  ///< files to write; empty: none
    int every = 1, threads = 0;
    std::vector<std::string> of_frames{},
        of_sweeps{};  ///< options that were given and have no meaning for the other
};

/// What was estimated, from what, and how.
struct EstimatedRun {
    std::string kind, sensor, target, method;  ///< kind: "camera", "lidar" or "cameras"
    std::string scene, item;                   ///< item: "frame", "sweep" or "pair"
};
/// Prints the summary, writes `csv` and `picture`, and returns the document.
[[nodiscard]] Outcome report_run(const RunEstimate& options, const EstimatedRun& of,
                                 const std::vector<TrackedFrame>& tracked);

[[nodiscard]] Outcome estimate_run(const RunEstimate& options, const TrackerOptions& tracker);

}  // namespace narpa::cli
