/// emulator/report.h - how a run went: as one JSON document for programs, as a few lines for people.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "emulator/emulator.h"
#include "emulator/log/statistics.h"

namespace narpa {

/// Frames, sweeps, commands received and lost, latency percentiles, deadlines missed, drops by cause. Each sensor's
/// part is in the list of its kind ("cameras").
[[nodiscard]] nlohmann::json report(const Emulator& emulator);
/// The same as text.
[[nodiscard]] std::string to_text(const Emulator& emulator);

/// Why a run has failed, a sentence each: a camera skipped more than half of its frames, or a lockstep run made no
/// frame and no packet. Empty: it has passed.
[[nodiscard]] std::vector<std::string> failures(const Emulator& emulator);
/// For each camera that skipped frames or was late: how much, and which budget or rate to change.
[[nodiscard]] std::vector<std::string> advice(const Emulator& emulator);

}  // namespace narpa
