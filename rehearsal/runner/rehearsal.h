/// rehearsal/runner/rehearsal.h - one rehearsal: starts emulator, navigation and dynamics, records and judges the
/// bus, stops them and writes the report.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"
#include "base/stop.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

struct RehearsalOptions {
    std::string scenario;                  ///< file
    std::vector<std::string> overrides{};  ///< KEY=VALUE: read_scenario
    std::string folder;                    ///< for everything that is written
    std::optional<std::uint64_t> seed;     ///< of dispersions and all noise; default: the scenario's
    bool real_time = false;
    std::string bus = "slcan:0";               ///< as `narpa run --can`
    std::map<std::string, std::string> video;  ///< camera -> device, in place of a FIFO in the folder
    std::string dynamics, navigation;          ///< shell commands in place of ours; "none": started by the user
    int threads = 0;                           ///< of emulator and navigation; 0: all cores
    double patience_s = 120;                   ///< wall time without progress
    bool page = true;                          ///< writes index.html
    bool keep_frames = false;  ///< writes the frames that the navigation gets as emulator/CAMERA.y4m
    std::string mcap{};        ///< MCAP file of the emulator's run; empty: none
    bool lean = false;         ///< of a run that passes keeps only kLeanFiles
    std::string programs;      ///< folder of narpa, narpa-dynamics, narpa-navigation; empty: ours
    std::string version;
};

/// A run in lockstep can be flown again with the seed in them.
inline constexpr std::array<std::string_view, 6> kLeanFiles{
    "rehearsal.json", "result.json", "dynamics/dynamics.json", "scenario.toml", "scene.toml", "map.toml"};

struct RehearsalResult {
    Verdict verdict;
    std::string page;  ///< empty: none
    double wall_s = 0;
    nlohmann::json result;  ///< as in result.json
    Status written{Ok{}};   ///< error of the first file of the report that could not be written
};

/// Where messages for people go.
struct Console {
    std::function<void(std::string_view)> print;
    /// Reports progress: the share that is done, the seconds of wall time left (each negative if not known), and a
    /// text.
    std::function<void(double share, double left_s, std::string_view)> progress;
    /// Polled if the user starts the navigation ("none"): whether it is ready; an Error if nobody can say so.
    /// Empty: it is taken as ready after ten seconds.
    std::function<Result<bool>()> navigation_ready{};
};

/// Errors: bad input (status 2), a missing device or program (3), programs that did not get ready; an earlier run's
/// files are then kept, and those of the failed start are in failed-start/. Later failures are part of the verdict.
/// Leaves in the folder: scenario.toml, scene.toml and map.toml as read, emulator/, dynamics/, navigation/ and
/// their .log files, rehearsal.json, result.json, junit.xml, index.html.
Result<RehearsalResult> run_rehearsal(const RehearsalOptions& options, const Console& console,
                                      const StopFlag& stop);

}  // namespace narpa::rehearsal
