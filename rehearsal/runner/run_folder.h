/// rehearsal/runner/run_folder.h - the folder that a rehearsal or a campaign writes into.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa::rehearsal {

/// Makes the folder, or takes one that has `mark` in it; an Error where it holds other files.
Status claim_folder(const std::string& folder, const char* mark);

/// Scenario and scene with all that they are based on, as one TOML text each, and 16 hexadecimal digits of both.
struct ScenarioTexts {
    std::string scenario, scene, hash;
};
Result<ScenarioTexts> scenario_texts(const std::string& scenario_file, const std::string& scene_file);

Status write_text(const std::string& file, std::string_view text);
/// An XML document of test suites.
Status write_junit(const std::string& file, const std::string& suites);

}  // namespace narpa::rehearsal
