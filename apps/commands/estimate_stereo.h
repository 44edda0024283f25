/// apps/commands/estimate_stereo.h - `narpa estimate --stereo LEFT,RIGHT`: poses, depth maps and point clouds from
/// the frames of two cameras.
#pragma once

#include "apps/cli.h"
#include "apps/commands/estimate_file.h"
#include "apps/commands/estimate_run.h"
#include "apps/commands/stereo_files.h"

namespace narpa::cli {

struct StereoFlags {
    std::string cameras;  ///< "LEFT,RIGHT"; empty: not given
    StereoFiles files;

    [[nodiscard]] bool on() const { return !cameras.empty(); }
    void add_to(Parser app);
};

/// Of a logged run: each frame of LEFT with that of RIGHT which was exposed at the same time.
[[nodiscard]] Outcome estimate_stereo_run(const RunEstimate& run, const StereoFlags& flags,
                                          const TrackerOptions& options);
/// Of two files.
[[nodiscard]] Outcome estimate_stereo_frames(const FileEstimate& file, const StereoFlags& flags,
                                             TrackerOptions options);

}  // namespace narpa::cli
