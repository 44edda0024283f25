/// rehearsal/runner/campaign.h - a Monte Carlo campaign: many runs of one scenario over its dispersions, and a
/// summary.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/shard.h"
#include "base/stop.h"
#include "rehearsal/report/campaign_report.h"
#include "rehearsal/runner/rehearsal.h"

namespace narpa::rehearsal {

struct CampaignOptions {
    RehearsalOptions run;    ///< options of each run; seed: that of run 1, run k has that + k - 1
    std::size_t runs = 100;  ///< each in FOLDER/runs/0001 ...
    int jobs = 1;            ///< runs in parallel
    bool replace = false;    ///< flies runs again that were flown with another scenario or seed
    Shard shard{};           ///< of the runs, counted from 0: the others are left alone
};

/// What a campaign is, and what of it has not been flown.
struct CampaignPlan {
    Scenario scenario;
    std::string scenario_hash;
    std::vector<RunResult> runs;           ///< of the shard; without a result where there is none of this scenario
    std::vector<std::uint32_t> missing{};  ///< runs of the shard without a result, counted from 0
};
/// Reads the folder only. An Error if a run was flown with another scenario or seed and is not to be replaced; if
/// the options do not allow many runs.
Result<CampaignPlan> plan_campaign(const CampaignOptions& options);

/// Starts `narpa rehearse` for each run that has no result of this scenario and seed yet, and summarises all in the
/// folder: summary.json, junit.xml, index.html. Returns the document of summary.json. An Error, before anything is
/// written, if a run was flown with another scenario or seed and is not to be replaced.
Result<nlohmann::json> run_campaign(const CampaignOptions& options, const Console& console, const StopFlag& stop);
/// Makes the folder of a campaign whose shards are flown by fly_shard.
[[nodiscard]] Status open_campaign(const std::string& folder);
/// Flies the runs of the shard that are missing, without a summary; other processes may fly other shards. Returns
/// {"runs": of the shard, "flown": of them now, "passed": all have a result}.
Result<nlohmann::json> fly_shard(const CampaignOptions& options, const Console& console, const StopFlag& stop);
/// Summarises the runs that there are, as run_campaign does, and flies none.
Result<nlohmann::json> gather_campaign(const CampaignOptions& options);
/// Arguments of `narpa` for runs with these options: all but those of folder, seed and threads.
[[nodiscard]] std::vector<std::string> rehearse_arguments(const RehearsalOptions& options);

/// The result and the draws in a run's folder; number and seed are left at 0.
[[nodiscard]] RunResult run_in(const std::string& folder);
/// The runs 1 to `runs` of a campaign, of them those of the shard, with the results that there are.
[[nodiscard]] std::vector<RunResult> campaign_runs(const std::string& folder, std::size_t runs,
                                                   std::uint64_t first_seed, const Shard& shard = {});
/// Summarises runs and writes summary.json, junit.xml, the charts and index.html. `facts`: further keys of the
/// summary, which is returned.
Result<nlohmann::json> write_summary(const std::string& folder, const Scenario& scenario,
                                     const std::vector<RunResult>& runs, const nlohmann::json& facts);

/// Progress of a run.
struct RunProgress {
    double share = 0;
    std::string text;  ///< "t = 12.0 s of about 93 s"; empty: not known yet
};
/// Progress from the last progress line in a run's log.
[[nodiscard]] RunProgress progress_of(const std::string& log);

/// True if a run's folder has a result of this scenario and seed.
[[nodiscard]] bool is_done(const std::string& folder, const std::string& scenario_hash, std::uint64_t seed);

}  // namespace narpa::rehearsal
