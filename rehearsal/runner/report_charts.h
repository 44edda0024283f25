/// rehearsal/runner/report_charts.h - the charts of the report pages: their data as a plot document (plot/plot.h),
/// and what narpa-plot has drawn of it as HTML text.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "base/result.h"
#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// What the page of one run shows.
struct Report {
    const Scenario& scenario;
    const BusRecord& bus;
    const Verdict& verdict;
};

/// Plot documents. Lengths in m, times in s of the scenario. `contacts`: the "contact" objects of result.json, one
/// for each run that made contact.
[[nodiscard]] nlohmann::json rehearsal_plot(const Report& report);
[[nodiscard]] nlohmann::json campaign_plot(const Scenario& scenario, std::span<const nlohmann::json> contacts);

/// Writes the document as FOLDER/charts.json and has its charts drawn into FOLDER/charts.
[[nodiscard]] Status draw_charts(const std::string& folder, const nlohmann::json& document);

// The charts of FOLDER/charts that exist. Where there is none, a sentence on how to draw them.

/// Path of the chaser's port in three views, and the last metres.
[[nodiscard]] std::string approach_charts(const std::string& folder);
/// Range and rates over time, with the guidance's phases.
[[nodiscard]] std::string motion_charts(const std::string& folder);
/// Error of the navigation and three standard deviations, for each of the six components.
[[nodiscard]] std::string error_charts(const std::string& folder);
/// Pose command to hand-over over time.
[[nodiscard]] std::string latency_chart(const std::string& folder);
/// States at contact of all runs.
[[nodiscard]] std::string campaign_contact_charts(const std::string& folder);

/// A table: each condition as a bar beside its limits.
[[nodiscard]] std::string contact_bars(const ContactConditions& conditions);

}  // namespace narpa::rehearsal
