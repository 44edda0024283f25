/// emulator/report.h - how a run went: as one JSON document for programs, as a few lines for people.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "emulator/emulator.h"

namespace narpa {

/// Frames, sweeps, commands received and lost, latency percentiles, deadlines missed, drops by cause.
[[nodiscard]] nlohmann::json report(Emulator& emulator);
/// The same, in words; made from the JSON so that the two cannot disagree.
[[nodiscard]] std::string in_words(const nlohmann::json& report);

}  // namespace narpa
