/// rehearsal/runner/merge.h - one summary of several campaigns of a scenario, as flown on several machines.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"

namespace narpa::rehearsal {

/// Writes the summary of all runs in the campaigns `from`, in the order of their seeds, into `folder`, which is
/// new, empty or of an earlier summary; the runs stay where they are. Errors: runs of different scenarios, a seed
/// that was flown twice, no run with a result.
Result<nlohmann::json> merge_campaigns(const std::vector<std::string>& from, const std::string& folder);

}  // namespace narpa::rehearsal
