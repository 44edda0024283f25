/// rehearsal/runner/rehearsal.h - one rehearsal: starts emulator, navigation and dynamics, listens, judges, ends
/// them.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "rehearsal/judge/judge.h"

namespace narpa::rehearsal {

struct RehearsalOptions {
    std::string scenario;               ///< its file
    std::string folder;                 ///< takes everything
    std::optional<std::uint64_t> seed;  ///< of the dynamics; the scenario's unless given
    bool real_time = false;
    std::string bus = "slcan:0";               ///< as `narpa run --can`
    std::map<std::string, std::string> video;  ///< camera -> device, where it is not a FIFO in the folder
    std::string dynamics, navigation;          ///< commands for a shell in place of ours; "none": the user's own
    int threads = 0;                           ///< of the emulator's; 0: all cores
    double patience_s = 120;                   ///< wall time without progress
    bool page = true;                          ///< writes index.html
    std::string programs;                      ///< folder of narpa, narpa-dynamics, narpa-navigation; empty: ours
    std::string version;
};

struct RehearsalResult {
    Verdict verdict;
    std::string page;  ///< empty: none
    double wall_s = 0;
    nlohmann::json result;  ///< as in result.json
};

/// Told words for people as they come, and the line of progress (to be written over). Asked again and again, where
/// the navigation is the user's own to start ("none"), whether it listens; unless it can be asked, ten seconds have
/// to do.
struct Console {
    std::function<void(std::string_view)> say, progress;
    std::function<bool()> navigation_ready{};
};

/// Errors: bad input (status 2), a device or program that is missing (3), programs that could not begin. What goes
/// wrong once the bus is there is a verdict. Leaves in the folder: scenario.toml and scene.toml as read, emulator/,
/// dynamics/, navigation/ and their .log files, rehearsal.json, result.json, junit.xml, index.html.
Result<RehearsalResult> run_rehearsal(const RehearsalOptions& options, const Console& console,
                                      const StopFlag& stop);

/// Scenario and scene with all that they are based on, as one TOML text each, and 16 hexadecimal digits of both.
struct ScenarioTexts {
    std::string scenario, scene, hash;
};
Result<ScenarioTexts> scenario_texts(const std::string& scenario_file, const std::string& scene_file);

/// An XML document of test suites.
Status write_junit(const std::string& file, const std::string& suites);
Status write_text(const std::string& file, std::string_view text);
/// A new folder, or one that a rehearsal has left; an Error where something else is in it.
Status claim_folder(const std::string& folder, const char* mark);

}  // namespace narpa::rehearsal
