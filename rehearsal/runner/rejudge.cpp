#include "rehearsal/runner/rejudge.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "rehearsal/runner/campaign.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/rerun.h"
#include "rehearsal/runner/run_folder.h"
#include "rehearsal/runner/run_results.h"
#include "renderer/keys/toml_file.h"
#include "renderer/keys/toml_override.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {
namespace {

using nlohmann::json;

json document(const std::string& file) {
    json read = json::parse(read_text(file), nullptr, false);
    return read.is_discarded() ? json(nullptr) : read;
}

/// Whether a campaign's summary states its runs; the file may be from anyone.
bool states_runs(const json& summary) {
    constexpr std::uint64_t kMostRuns = 1'000'000;
    const auto number = [](const json& of, const char* key) {
        return of.is_object() && of.contains(key) && of[key].is_number_unsigned();
    };
    return number(summary, "runs") && summary["runs"].get<std::uint64_t>() <= kMostRuns &&
           summary.contains("each") && summary["each"].is_array() && !summary["each"].empty() &&
           number(summary["each"][0], "seed") && number(summary["each"][0], "run");
}

/// Replaces the gates by those of another file of the same scenario.
Status take_gates(const std::string& folder, const std::string& file, Scenario& flown) {
    std::vector<std::string> set = flown.overrides;
    std::erase_if(set, [](const std::string& s) { return table_of_override(s) == "gates"; });
    auto other = read_scenario(file, set);
    if (!other) return other.error();
    const auto difference = difference_from_flown(folder, *other);
    if (!difference) return difference.error();
    if (!difference->empty() && *difference != "[gates]")
        return Error{
            fmt::format("is not the scenario that was flown into {} ({} differ), expected other [gates] and "
                        "duration_s at most",
                        folder, *difference),
            file};
    flown.gates = std::move(other->gates);
    flown.duration_s = other->duration_s;
    return Ok{};
}

}  // namespace

Result<Scenario> flown_scenario(const std::string& folder, const json& record) {
    const auto set = record.value("set", std::vector<std::string>());
    auto scenario =
        read_scenario(folder + "/scenario.toml", set, {record.value("scene", ""), record.value("map", "")});
    if (!scenario) return scenario;
    const auto scene = TomlFile::read(scenario->scene, "scene", kSceneFileKeys, scenario->scene_overrides);
    if (!scene) return scene.error();
    if (scene->text() + '\n' != read_text(folder + "/scene.toml"))
        return Error{fmt::format("has changed since it was flown, expected what stands in {}/scene.toml", folder),
                     scenario->scene};
    return scenario;
}

Result<RehearsalResult> judge_run(const std::string& folder, const std::string& gates) {
    const auto lock = lock_folder(folder);
    if (!lock) return lock.error();
    auto record = read_record(folder);
    if (!record) return record.error();
    auto scenario = flown_scenario(folder, *record);
    if (!scenario) return scenario.error();
    if (!gates.empty())
        if (Status taken = take_gates(folder, gates, *scenario); !taken) return taken.error();
    if (std::error_code none; !std::filesystem::exists(folder + "/emulator/can.log", none))
        return Error{"no such file, expected the log of the run: --lean keeps none of runs that pass",
                     folder + "/emulator/can.log"};
    Judge judge(*scenario);
    if (Status read = accept_log(judge, folder + "/emulator/can.log"); !read) return read.error();
    const json before = document(folder + "/result.json");
    const auto is = [&](const char* key, auto is_good) { return record->contains(key) && is_good((*record)[key]); };
    const auto text = [](const json& v) { return v.is_string(); };
    if (!is("wall_s", [](const json& v) { return v.is_number(); })) (*record)["wall_s"] = 0.0;
    if (!is("trouble", text))
        (*record)["trouble"] = before.is_object() && before.contains("trouble") && text(before["trouble"])
                                   ? before["trouble"]
                                   : json("");
    if (!is("version", text)) (*record)["version"] = "";
    if (!gates.empty()) (*record)["judged_by"] = gates;
    return write_results(*scenario, judge, *record, folder, Pages::all);
}

Result<json> judge_campaign(const std::string& folder, const std::string& gates, const Console& console) {
    const auto lock = claim_folder(folder, FolderKind::campaign);
    if (!lock) return lock.error();
    json facts = document(folder + "/summary.json");
    if (!states_runs(facts))
        return Error{
            "holds no summary of runs, expected a campaign that has ended: the same `narpa rehearse` command "
            "goes on with it",
            folder};
    const std::size_t wanted = facts["runs"];
    const std::uint64_t first_seed =
        facts["each"][0]["seed"].get<std::uint64_t>() - facts["each"][0]["run"].get<std::uint64_t>() + 1;
    std::vector<RunResult> runs = campaign_runs(folder, wanted, first_seed);
    std::string last;
    for (RunResult& run : runs) {
        console.progress(static_cast<double>(run.run - 1) / static_cast<double>(wanted), -1,
                         fmt::format("run {} of {}", run.run, wanted));
        if (!run.result.is_object()) continue;
        last = folder + "/" + run.folder;
        const auto judged = judge_run(last, gates);
        if (!judged) return judged.error();
        if (!judged->written) return judged->written.error();
        run.result = judged->result;
    }
    const auto record = read_record(last);
    if (!record) return record.error();
    const auto scenario = flown_scenario(last, *record);
    if (!scenario) return scenario.error();
    json kept{{"scenario_hash", facts["scenario_hash"]}, {"version", facts["version"]}};
    if (!gates.empty()) kept["judged_by"] = gates;
    return write_summary(folder, *scenario, runs, kept);
}

}  // namespace narpa::rehearsal
