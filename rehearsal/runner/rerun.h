/// rehearsal/runner/rerun.h - a rehearsal in lockstep once more, and where it first differs.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/result.h"
#include "rehearsal/runner/rehearsal.h"

namespace narpa::rehearsal {

/// The first place where two files differ.
struct Difference {
    std::size_t line = 0;  ///< from 1, of the lines that are compared
    std::string is, was;   ///< what stands there now and stood before; empty: the file is at its end
};
/// Line by line; heartbeats of an emulator that starts are passed over: who is on the bus by then is chance.
[[nodiscard]] std::optional<Difference> first_difference(const std::string& is, const std::string& was);

/// "t = 3.050 s: dynamics report + 1 (id 0x751), data ..." of a line of a candump log; the line itself where it is
/// none.
[[nodiscard]] std::string describe_message(const Scenario& scenario, const std::string& line);

/// What rehearsal.json tells; Errors where it is not there or not one.
Result<nlohmann::json> read_record(const std::string& folder);

/// Runs it again with the same seed into a temporary folder and compares bus, ledgers, truths and the logs of
/// navigation and dynamics. Only of what was run in lockstep.
Result<nlohmann::json> rerun(const std::string& folder, int threads, const std::string& version,
                             const Console& console, const StopFlag& stop);

}  // namespace narpa::rehearsal
