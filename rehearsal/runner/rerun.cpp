#include "rehearsal/runner/rerun.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "protocols/can/candump.h"
#include "protocols/can/messages.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/run_folder.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// A temporary folder; the destructor removes it.
class TemporaryFolder {
public:
    TemporaryFolder() {
        std::error_code unknown;
        std::string pattern = (fs::temp_directory_path(unknown) / "narpa-replay-XXXXXX").string();
        if (::mkdtemp(pattern.data())) path_ = pattern;
    }
    ~TemporaryFolder() {
        std::error_code ignored;
        if (!path_.empty()) fs::remove_all(path_, ignored);
    }
    TemporaryFolder(const TemporaryFolder&) = delete;
    TemporaryFolder& operator=(const TemporaryFolder&) = delete;
    [[nodiscard]] const std::string& path() const { return path_; }

private:
    std::string path_;
};

bool is_starting(const std::string& line) {
    CandumpLine parsed;
    Heartbeat beat;
    return parse_candump(line, parsed) == nullptr && decode(parsed.frame, 0, beat) == DecodeStatus::complete &&
           beat.state == RunState::starting;
}

/// Drops the last column of a LiDAR's sweeps: how many packets receivers on this machine lost is random.
bool next_line(std::ifstream& file, bool sweeps, std::string& line) {
    while (std::getline(file, line)) {
        if (sweeps) line.resize(std::min(line.size(), line.rfind(',')));
        if (!is_starting(line)) return true;
    }
    line.clear();
    return false;
}

/// Checks for the files that each rehearsal in lockstep leaves: if one is missing, the comparison would be
/// incomplete.
Status check_logs(const std::string& folder, const Scenario& scenario, const json& record) {
    std::vector<std::string> files{"emulator/can.log"};
    for (const std::string& camera : scenario.navigation.cameras)
        for (const char* log : {".ledger.csv", ".truth.csv"}) files.push_back("emulator/" + camera + log);
    for (const std::string& lidar : scenario.navigation.lidars)
        files.push_back("emulator/" + lidar + ".sweeps.csv");
    if (record["dynamics"] == "") files.emplace_back("dynamics/truth.csv");
    if (record["navigation"] == "") files.emplace_back("navigation/navigation.csv");
    for (const std::string& name : files) {
        std::error_code unknown;
        const std::string file = folder + "/" + name;
        if (!fs::is_regular_file(file, unknown))
            return Error{"no such file, expected the log of the rehearsal to be whole", file};
    }
    return Ok{};
}

/// Files that do not depend on wall time.
std::vector<std::string> comparable(const std::string& folder) {
    std::vector<std::string> files{"emulator/can.log"};
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder + "/emulator", none)) {
        const std::string name = entry.path().filename().string();
        if (name.ends_with(".ledger.csv") || name.ends_with(".truth.csv") || name.ends_with(".sweeps.csv"))
            files.push_back("emulator/" + name);
    }
    for (const char* own : {"dynamics/truth.csv", "navigation/navigation.csv"})
        if (fs::exists(folder + "/" + own, none)) files.emplace_back(own);
    std::sort(files.begin() + 1, files.end());
    return files;
}

}  // namespace

std::optional<Difference> first_difference(const std::string& is, const std::string& was) {
    std::ifstream a(is, std::ios::binary), b(was, std::ios::binary);
    const bool sweeps = was.ends_with(".sweeps.csv");
    Difference d;
    for (;;) {
        ++d.line;
        const bool more_a = next_line(a, sweeps, d.is), more_b = next_line(b, sweeps, d.was);
        if (!more_a && !more_b) return std::nullopt;
        if (more_a != more_b || d.is != d.was) return d;
    }
}

std::string describe_message(const Scenario& s, const std::string& line) {
    CandumpLine parsed;
    if (line.empty()) return "nothing more";
    if (parse_candump(line, parsed) != nullptr) return line;
    std::vector<CanBody> bodies{{s.target.body, s.target.can_id}, {s.chaser.body, s.chaser.can_id}};
    if (s.attractor) bodies.push_back({s.attractor->first, s.attractor->second});
    const std::string what = message_name(parsed.frame.id, bodies);
    return fmt::format("t = {:.6f} s: {} ({})", static_cast<double>(parsed.t_ns) * 1e-9, what,
                       line.substr(line.rfind(' ') + 1));
}

namespace {

/// Absent, or a list of texts: logs of earlier versions have none.
bool is_list_of_texts(const json& record, const char* key) {
    if (!record.contains(key)) return true;
    return record[key].is_array() && std::ranges::all_of(record[key], [](const json& v) { return v.is_string(); });
}

}  // namespace

Result<json> read_record(const std::string& folder) {
    const std::string file = folder + "/rehearsal.json";
    json record = json::parse(read_text(file), nullptr, false);
    const auto is_text = [&](const char* key) { return record.contains(key) && record[key].is_string(); };
    const bool good = record.is_object() && record.contains("format") && record["format"] == 1 &&
                      is_text("scenario") && is_text("scenario_hash") && is_text("mode") &&
                      is_list_of_texts(record, "set") && record.contains("seed") &&
                      record["seed"].is_number_unsigned() && is_text("dynamics") && is_text("navigation");
    if (!good) return Error{"is not the record of a rehearsal", file};
    return record;
}

namespace {

/// The command that replaces a program, or empty. A log may be from anyone: the command in it is only shown, never
/// run.
Result<std::string> replacement(const json& record, const std::string& folder, const std::string& program,
                                const std::string& given) {
    if (!given.empty()) return given;
    const json& logged = record[program];
    if (logged == "") return std::string();
    if (logged == "none")
        return Error{
            fmt::format("a program was started by hand in it: expected --{} COMMAND, or {}/emulator, whose "
                        "frames can be replayed alone",
                        program, folder),
            folder};
    return Error{
        fmt::format(
            "the {0} was the command {1}; a command in a log is never run by itself: expected --{0} 'COMMAND' "
            "if you trust it, or {2}/emulator, whose frames can be replayed alone",
            program, logged.dump(-1, ' ', true, json::error_handler_t::replace), folder),
        folder + "/rehearsal.json"};
}

}  // namespace

Result<json> rerun(const RerunOptions& options, const Console& console, const StopFlag& stop) {
    const std::string& folder = options.folder;
    const auto record = read_record(folder);
    if (!record) return record.error();
    const auto dynamics = replacement(*record, folder, "dynamics", options.dynamics);
    if (!dynamics) return dynamics.error();
    const auto navigation = replacement(*record, folder, "navigation", options.navigation);
    if (!navigation) return navigation.error();
    const auto overrides = record->value("set", std::vector<std::string>{});
    const auto scenario = read_scenario((*record)["scenario"].get<std::string>(), overrides);
    if (!scenario) return scenario.error();
    const auto texts = scenario_texts(*scenario);
    if (!texts) return texts.error();
    if (texts->hash != (*record)["scenario_hash"])
        return Error{
            fmt::format("has changed since it was run, or its scene: expected what stands in {}/scenario.toml "
                        "and scene.toml",
                        folder),
            scenario->file, 0, 0, ErrorKind::failed};
    if (const Status whole = check_logs(folder, *scenario, *record); !whole) return whole.error();
    const TemporaryFolder again;
    RehearsalOptions o;
    o.scenario = scenario->file;
    o.overrides = overrides;
    o.folder = again.path();
    o.seed = (*record)["seed"].get<std::uint64_t>();
    o.dynamics = *dynamics;
    o.navigation = *navigation;
    o.threads = options.threads;
    o.page = false;
    o.version = options.version;
    o.programs = options.programs;
    o.mcap = options.mcap;
    const auto done = run_rehearsal(o, console, stop);
    if (!done) return done.error();
    if (!done->written) return done->written.error();

    json files = json::array();
    bool same = true;
    for (const std::string& name : comparable(folder)) {
        const auto difference = first_difference(again.path() + "/" + name, folder + "/" + name);
        files.push_back({{"file", name}, {"same", !difference}});
        if (!difference) continue;
        same = false;
        const bool bus = name.ends_with("can.log");
        const auto words = [&](const std::string& line) { return bus ? describe_message(*scenario, line) : line; };
        files.back().update(
            {{"line", difference->line}, {"is", words(difference->is)}, {"was", words(difference->was)}});
        console.print(fmt::format("{}/{}: line {} differs first\n  was {}\n  is  {}", folder, name,
                                  difference->line, words(difference->was), words(difference->is)));
    }
    console.print(same ? fmt::format("{}: {} files repeat byte for byte", folder, files.size())
                       : fmt::format("{}: expected the scene, its meshes and the programs as they were", folder));
    return json{{"passed", same}, {"log", folder}, {"mode", "lockstep"}, {"files", files}};
}

}  // namespace narpa::rehearsal
