/// apps/cli.h - the subcommands of `narpa`, one file each, and what they share with those of `narpa bench`. Text
/// goes to standard error, the JSON document of --json to standard output; exit status: base/result.h.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "apps/options.h"
#include "apps/progress.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// The result of a subcommand, for --json, or an Error. Null: standard output has its document already. The
/// document of a check that can fail has `passed`; false gives exit status 1. A document with results of a command
/// that failed later also has `error` (to_json).
using Outcome = Result<nlohmann::json>;
using Command = std::function<Outcome()>;

/// Each adds its subcommand and returns what runs when it is chosen.
Command add_list(Parser app);
Command add_check(Parser app);
Command add_run(Parser app);
Command add_fly(Parser app);
Command add_render(Parser app);
Command add_map(Parser app);
Command add_scan(Parser app);
Command add_replay(Parser app);
Command add_compare(Parser app);
Command add_estimate(Parser app);
Command add_calibrate(Parser app);
Command add_dataset(Parser app);
Command add_rehearse(Parser app);
Command add_judge(Parser app);

struct CommandTexts {
    std::string name, description;
    std::vector<std::string> examples;  ///< command lines for --help
};
/// main() of a program of subcommands: parses the command line, runs the chosen one, prints what it returns.
/// Returns the exit status.
int run_commands(int argc, char** argv, const CommandTexts& texts,
                 const std::vector<std::function<Command(Parser)>>& adders);
/// Prints the result of a subcommand and returns the exit status.
int finish(const Outcome& outcome, bool json);

/// {"error": ...}, with the exit status.
nlohmann::json to_json(const Error& e);
/// Reads a frame as read_frame does, and prints its warnings.
Result<std::vector<std::uint8_t>> load_frame(const std::string& path, const Camera& camera);
/// Makes the folder of a file that is to be written; nothing where `file` is empty.
Status make_folder_of(const std::string& file);
/// The same for a picture of narpa-plot; an Error where its file extension is not supported.
Status make_folder_of_picture(const std::string& file);
/// "NAME=VALUE" -> {NAME, VALUE}; an Error that names what was expected.
Result<std::pair<std::string, std::string>> split_pair(const std::string& text, std::string_view expected);

}  // namespace narpa::cli
