/// rehearsal/runner/run_folder.h - the folder that a rehearsal or a campaign writes into.
#pragma once

#include <string>

#include "base/result.h"
#include "drivers/descriptor.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Creates the folder and locks it until the descriptor closes; an Error if another program has locked it.
Result<Descriptor> lock_folder(const std::string& folder);
/// The same for a folder that is empty or contains `mark`; an Error if it holds other files.
Result<Descriptor> claim_folder(const std::string& folder, const char* mark);

/// Scenario, scene and the navigation's map, each with everything it is based on, as one TOML text, and a hash of
/// all as 16 hexadecimal digits. Without a map its text is empty.
struct ScenarioTexts {
    std::string scenario, scene, map, hash;
};
Result<ScenarioTexts> scenario_texts(const Scenario& scenario);

}  // namespace narpa::rehearsal
