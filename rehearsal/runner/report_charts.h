/// rehearsal/runner/report_charts.h - every chart of the report pages, as HTML text. The only user of chart.h.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// What the page of one run shows.
struct Report {
    const Scenario& scenario;
    const BusRecord& bus;
    const Verdict& verdict;
};

/// Path of the chaser's port in three views, and the last metres.
[[nodiscard]] std::string approach_charts(const Report& report);
/// Range and rates over time, with the guidance's phases.
[[nodiscard]] std::string motion_charts(const Report& report);
/// Error of the navigation and three standard deviations, for each of the six components.
[[nodiscard]] std::string error_charts(const Report& report);
/// Pose command to hand-over over time.
[[nodiscard]] std::string latency_chart(const Report& report);
/// Each condition as a bar beside its limits.
[[nodiscard]] std::string contact_bars(const ContactConditions& conditions);

/// `contacts`: the "contact" objects of result.json, one a run that made contact.
[[nodiscard]] std::string campaign_contact_charts(const std::vector<nlohmann::json>& contacts);

}  // namespace narpa::rehearsal
