/// rehearsal/runner/rerun.h - runs a recorded lockstep rehearsal again and finds the first difference.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "base/result.h"
#include "rehearsal/runner/rehearsal.h"
#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// The first place where two files differ.
struct Difference {
    std::size_t line = 0;  ///< from 1, counting only the lines that are compared
    std::string is, was;   ///< now and before; empty: end of file
};
/// Compares line by line; skips heartbeats of the starting emulator, as which of them a client receives is random.
[[nodiscard]] std::optional<Difference> first_difference(const std::string& is, const std::string& was);

/// "t = 3.050 s: dynamics report + 1 (id 0x751), data ..." for a line of a candump log; the line itself if it is
/// not one.
[[nodiscard]] std::string describe_message(const Scenario& scenario, const std::string& line);

/// rehearsal.json. Errors: missing, or not the record of a rehearsal.
Result<nlohmann::json> read_record(const std::string& folder);

struct RerunOptions {
    std::string folder;                ///< of the rehearsal
    std::string dynamics, navigation;  ///< shell commands in place of ours; empty: ours
    int threads = 0;
    std::string version;
    std::string programs;  ///< as in RehearsalOptions
    std::string mcap{};    ///< as in RehearsalOptions
};
/// Runs it with the same seed into a temporary folder and compares the bus, ledgers, truths and the logs of
/// navigation and dynamics. For runs in lockstep. A command that the record names is never run: it is an Error
/// unless the options name a replacement.
Result<nlohmann::json> rerun(const RerunOptions& options, const Console& console, const StopFlag& stop);

}  // namespace narpa::rehearsal
