/// rehearsal/runner/run_folder.h - the folder that a rehearsal or a campaign writes into.
#pragma once

#include <cstdint>
#include <string>

#include "base/result.h"
#include "drivers/descriptor.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// Whether other programs may have the lock at the same time, all of them `shared`.
enum class Lock : std::uint8_t { exclusive, shared };
/// Creates the folder and locks it until the descriptor closes; an Error if another program has locked it.
Result<Descriptor> lock_folder(const std::string& folder, Lock lock = Lock::exclusive);
/// What a folder of results holds; the last: only the summary of campaigns elsewhere.
enum class FolderKind : std::uint8_t { run, campaign, summary };

/// The same for a folder that is empty or of this kind; an Error if it holds other files.
Result<Descriptor> claim_folder(const std::string& folder, FolderKind kind, Lock lock = Lock::exclusive);
/// An Error if it holds no results.
Result<FolderKind> kind_of_folder(const std::string& folder);

/// Scenario, scene and the navigation's map, each with everything it is based on, as one TOML text, and a hash of
/// all as 16 hexadecimal digits. Without a map its text is empty.
struct ScenarioTexts {
    std::string scenario, scene, map, hash;
};
Result<ScenarioTexts> scenario_texts(const Scenario& scenario);

/// How what was flown in a run's folder differs from `scenario`: "[gates]", "[chaser], the scene"; empty: it does
/// not. `[scenario]` is not compared. An Error if the folder's scenario.toml cannot be read.
Result<std::string> difference_from_flown(const std::string& folder, const Scenario& scenario);

}  // namespace narpa::rehearsal
