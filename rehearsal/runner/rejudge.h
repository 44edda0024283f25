/// rehearsal/runner/rejudge.h - judges what was flown anew, by the messages in its logs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/result.h"
#include "rehearsal/runner/rehearsal.h"

namespace narpa::rehearsal {

/// The scenario that was flown into a run's folder, from the copy in it. `record`: read_record. An Error if the
/// scene has changed since.
Result<Scenario> flown_scenario(const std::string& folder, const nlohmann::json& record);

/// Judges a recorded run by its own gates or, if `gates` is not empty, by `[gates]` and `duration_s` of that
/// scenario file, which must otherwise be the scenario that was flown. Writes result.json, junit.xml, charts and
/// index.html anew; nothing that was flown changes.
Result<RehearsalResult> judge_run(const std::string& folder, const std::string& gates);

/// The same for each run of a campaign, and the summary of the runs that have a result.
Result<nlohmann::json> judge_campaign(const std::string& folder, const std::string& gates, const Console& console);

}  // namespace narpa::rehearsal
