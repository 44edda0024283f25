#include "rehearsal/runner/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "rehearsal/runner/campaign.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/rejudge.h"
#include "rehearsal/runner/rerun.h"
#include "rehearsal/runner/run_folder.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// The runs with a result in a campaign's folder; their folders as given.
Result<std::vector<RunResult>> runs_in(const std::string& campaign) {
    const auto kind = kind_of_folder(campaign);
    if (!kind) return kind.error();
    if (*kind != FolderKind::campaign)
        return Error{"holds a single run, expected the folder of a campaign", campaign};
    std::vector<RunResult> runs;
    std::error_code failed;
    for (const auto& entry : fs::directory_iterator(campaign + "/runs", failed)) {
        RunResult run = run_in(entry.path().string());
        if (run.result.is_object() && run.result.contains("seed") && run.result["seed"].is_number_unsigned())
            runs.push_back(std::move(run));
    }
    for (RunResult& run : runs) run.seed = run.result["seed"];
    return runs;
}

/// An Error for runs of another scenario than the first's, and for a seed that two runs have. `runs`: by seed.
Status check_same(const std::vector<RunResult>& runs) {
    for (const RunResult& run : runs)
        if (run.result["scenario_hash"] != runs.front().result["scenario_hash"])
            return Error{fmt::format("was flown with another scenario than {}", runs.front().folder), run.folder};
    const auto twice = std::ranges::adjacent_find(runs, {}, &RunResult::seed);
    if (twice == runs.end()) return Ok{};
    return Error{fmt::format("was flown with seed {}, as {} was, expected seeds of its own (--seed)", twice->seed,
                             twice->folder),
                 std::next(twice)->folder};
}

}  // namespace

Result<json> merge_campaigns(const std::vector<std::string>& from, const std::string& folder) {
    std::vector<RunResult> runs;
    for (const std::string& campaign : from) {
        auto of_one = runs_in(campaign);
        if (!of_one) return of_one.error();
        std::ranges::move(*of_one, std::back_inserter(runs));
    }
    if (runs.empty()) return Error{"no run in it has a result", from.front()};
    std::ranges::sort(runs, {}, &RunResult::seed);
    if (Status same = check_same(runs); !same) return same.error();
    const auto record = read_record(runs.front().folder);
    if (!record) return record.error();
    const auto scenario = flown_scenario(runs.front().folder, *record);
    if (!scenario) return scenario.error();
    const auto lock = claim_folder(folder, FolderKind::summary);
    if (!lock) return lock.error();
    std::error_code failed;
    for (std::size_t k = 0; k < runs.size(); ++k) {
        runs[k].run = k + 1;
        const fs::path beside = fs::proximate(runs[k].folder, folder, failed);
        if (!failed) runs[k].folder = beside.string();
    }
    return write_summary(
        folder, *scenario, runs,
        {{"scenario_hash", (*record)["scenario_hash"]}, {"version", (*record)["version"]}, {"merged", from}});
}

}  // namespace narpa::rehearsal
