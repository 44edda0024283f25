/// apps/commands/estimate_batch.h - `narpa estimate RUN --batch`: all frames and sweeps of a logged run in one
/// least-squares problem.
#pragma once

#include <optional>
#include <string>

#include "apps/cli.h"
#include "apps/commands/estimate_run.h"
#include "estimator/batch/batch_solver.h"

namespace narpa::cli {

struct BatchFlags {
    bool on = false;
    std::string unknowns, model_error, path_sigma;  ///< as on the command line; empty: not given

    void add_to(Parser app);
};

/// `run.sensor` is not used. `camera`, `lidar`: names; both empty: the first camera of the run's scene, and the
/// first LiDAR on the same body.
struct BatchSensors {
    std::string camera, lidar;
};

[[nodiscard]] Outcome estimate_batch(const RunEstimate& run, const BatchSensors& sensors, const BatchFlags& flags,
                                     const TrackerOptions& tracker);

/// Parses NAME=VALUE,... with the names of batch_unknowns(), or of their groups. `option`: for messages. `known`:
/// only names with a value there, which a NAME alone has; null: all names, none alone.
[[nodiscard]] Result<BatchValues> batch_values(const std::string& text, const std::string& option,
                                               const BatchValues* known, bool may_be_negative);

}  // namespace narpa::cli
