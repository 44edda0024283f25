/// rehearsal/runner/run_folder.h - the folder that a rehearsal or a campaign writes into.
#pragma once

#include <string>

#include "base/result.h"
#include "drivers/descriptor.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Makes the folder and locks it until the descriptor closes; an Error where another program has locked it.
Result<Descriptor> lock_folder(const std::string& folder);
/// The same for a folder that is empty or has `mark` in it; an Error where it holds other files.
Result<Descriptor> claim_folder(const std::string& folder, const char* mark);

/// Scenario, scene and the navigation's map with all that they are based on, as one TOML text each, and 16
/// hexadecimal digits of all of it. Without a map its text is empty.
struct ScenarioTexts {
    std::string scenario, scene, map, hash;
};
Result<ScenarioTexts> scenario_texts(const Scenario& scenario);

/// An XML document of test suites.
Status write_junit(const std::string& file, const std::string& suites);

}  // namespace narpa::rehearsal
