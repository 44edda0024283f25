/// rehearsal/report/campaign_report.h - the summary of a campaign as JSON, as an HTML page (campaign.html) and as
/// JUnit XML.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "rehearsal/scenario/scenario.h"

namespace narpa::rehearsal {

/// One run of a campaign.
struct RunResult {
    std::size_t run = 0;
    std::uint64_t seed = 0;
    std::string folder;      ///< within the campaign's
    nlohmann::json result;   ///< the content of its result.json; null: none
    nlohmann::json draws{};  ///< "draws" of its dynamics.json, in standard deviations; null: none
};

/// The "contact" objects of the runs that made contact.
[[nodiscard]] std::vector<nlohmann::json> contacts_of(const std::vector<RunResult>& runs);
/// Success rate with its interval, failures by gate and reason, contact conditions, navigation.
[[nodiscard]] nlohmann::json summarise(const Scenario& scenario, const std::vector<RunResult>& runs);
/// "98 of 100 runs succeeded: 98.0 %", or the number flown if not all were.
[[nodiscard]] std::string campaign_headline(const nlohmann::json& summary);
/// Embeds the charts of FOLDER/charts.
[[nodiscard]] std::string campaign_page(const Scenario& scenario, const nlohmann::json& summary,
                                        const std::string& folder);
/// An XML document with a test case for each run, by its first failed gate.
[[nodiscard]] std::string campaign_junit(const std::string& suite, const std::vector<RunResult>& runs);

}  // namespace narpa::rehearsal
