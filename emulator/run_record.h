/// emulator/run_record.h - what a run's log folder tells of the run as a whole: run.json.
#pragma once

#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The scene's file, and what rendered it, with what the command line had changed.
struct RunRecord {
    std::string scene_file;  ///< absolute
    RenderSettings render;
};

/// Writes FOLDER/run.json.
Status write_run_record(const std::string& folder, const Scene& scene);
/// Reads it back. Errors name the file and what was expected.
Result<RunRecord> read_run_record(const std::string& folder);

}  // namespace narpa
