/// emulator/report.h - how a run went: as one JSON document for programs, as a few lines for people.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "emulator/emulator.h"

namespace narpa {

/// Frames, sweeps, commands received and lost, latency percentiles, deadlines missed, drops by cause.
[[nodiscard]] nlohmann::json report(Emulator& emulator);
/// How many frames were handed over how long before or after their deadline: percentiles, and counts by bins.
[[nodiscard]] nlohmann::json lateness(const SignedHistogram& late);
/// "598 1 to 3 ms early, 2 0.3 to 1 ms late": the bins that hold any.
[[nodiscard]] std::string lateness_in_words(const nlohmann::json& lateness);
/// The same, in words; made from the JSON so that the two cannot disagree.
[[nodiscard]] std::string in_words(const nlohmann::json& report);

}  // namespace narpa
