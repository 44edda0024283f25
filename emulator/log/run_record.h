/// emulator/log/run_record.h - what a run's log folder tells of the run as a whole: run.json.
#pragma once

#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The scene's file, and of its [render] what decides a frame's bytes beside its ledger, so that a file changed
/// since does not. Budgets, which the command line may have changed, are not here: each frame's ledger has its own.
struct RunRecord {
    std::string scene_file;  ///< absolute
    RenderSettings::Method method{};
    int max_depth = 0;
    std::uint64_t seed = 0;
};

/// Writes FOLDER/run.json.
Status write_run_record(const std::string& folder, const Scene& scene);
/// Reads it back. Errors name file, line and what was expected.
Result<RunRecord> read_run_record(const std::string& folder);

}  // namespace narpa
