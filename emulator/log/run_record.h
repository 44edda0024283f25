/// emulator/log/run_record.h - a run's log folder as a whole, and run.json in it: the settings of the run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The scene's file, and the keys of [render] that decide a frame's bytes together with its ledger, so that later
/// changes of the file have no effect. Budgets are in each frame's ledger.
/// A file that a scene was read from.
struct RecordedFile {
    std::string file;          ///< absolute
    std::uint64_t size_b = 0;  ///< of its content
    std::uint64_t fnv1a = 0;

    bool operator==(const RecordedFile&) const = default;
};

struct RunRecord {
    std::string scene_file;                ///< absolute
    std::vector<std::string> overrides{};  ///< Scene::overrides
    RenderSettings::Method method{};
    int max_depth = 0;
    std::uint64_t seed = 0;
    std::vector<RecordedFile> files{};  ///< scene, meshes, images, ...; empty in logs of narpa before it wrote them
};

/// Removes the log of an earlier run, whose sensors may be others, from its folder. Other files stay, and so do
/// links, which the next log writes through. Error: run.json is not a run's; nothing is removed.
Status remove_run(const std::string& folder);
/// Writes FOLDER/run.json, FOLDER/scene.toml: the scene with all that it is based on, and FOLDER/calibration.json.
Status write_run_record(const std::string& folder, const Scene& scene);
/// Reads it back. Errors name file, line and what was expected.
Result<RunRecord> read_run_record(const std::string& folder);
/// The run's scene with the settings of the run; `scene_file`: another file in place of its own, empty: none.
Result<Scene> read_run_scene(const RunRecord& record, const std::string& scene_file = "");
/// Of the files that the run's scene was read from, those whose content is another now or that are gone.
[[nodiscard]] std::vector<std::string> changed_files(const RunRecord& record);

}  // namespace narpa
