/// apps/commands/rehearsal_text.h - prints the results of rehearsals and campaigns.
#pragma once

#include "apps/cli.h"
#include "rehearsal/runner/rehearsal.h"

namespace narpa::cli {

/// Prints the gates, each with its reason and below it the details, and the outcome; returns the run's document.
[[nodiscard]] Outcome print_run(const Result<rehearsal::RehearsalResult>& done);
/// Prints the success rate and the contact conditions of a campaign; returns its summary.
[[nodiscard]] Outcome print_campaign(Result<nlohmann::json> summary, const std::string& folder);

}  // namespace narpa::cli
