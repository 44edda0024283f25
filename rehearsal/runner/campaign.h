/// rehearsal/runner/campaign.h - a Monte Carlo campaign: many runs of one scenario over its dispersions, and a
/// summary.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "base/result.h"
#include "base/stop.h"
#include "rehearsal/report/campaign_report.h"
#include "rehearsal/runner/rehearsal.h"

namespace narpa::rehearsal {

struct CampaignOptions {
    RehearsalOptions run;    ///< options of each run; seed: that of run 1, run k has that + k - 1
    std::size_t runs = 100;  ///< each in FOLDER/runs/0001 ...
    int jobs = 1;            ///< runs in parallel
};

/// Starts `narpa rehearse` for each run that has no result of this scenario and seed yet, and summarises all in the
/// folder: summary.json, junit.xml, index.html. Returns the document of summary.json.
Result<nlohmann::json> run_campaign(const CampaignOptions& options, const Console& console, const StopFlag& stop);

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
