/// rehearsal/report/run_report.h - the report of a rehearsal as one self-contained HTML page (run.html), as JUnit
/// XML (junit.xml), and its charts.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// `record` as in rehearsal.json. Embeds the pictures of FOLDER/navigation and the charts of FOLDER/charts.
[[nodiscard]] std::string rehearsal_page(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict,
                                         const nlohmann::json& record, const std::string& folder);

/// An XML document with a test suite of this name and a test case for each gate.
[[nodiscard]] std::string junit(const Verdict& verdict, const std::string& suite, double wall_s);
/// The same for other test cases: objects with "name", "state" (kGateStates), "type" of a failure, "reason",
/// "text".
[[nodiscard]] std::string junit(const std::string& suite, double wall_s, nlohmann::json cases);

/// Documents for narpa-plot (plot/plot.h). Lengths in m, times in s of the scenario. `contacts`: the "contact"
/// objects of result.json, one for each run that made contact.
[[nodiscard]] nlohmann::json rehearsal_plot(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict);
[[nodiscard]] nlohmann::json campaign_plot(const Scenario& scenario, std::span<const nlohmann::json> contacts);
/// Writes the document as FOLDER/charts.json and has its charts drawn into FOLDER/charts.
[[nodiscard]] Status draw_charts(const std::string& folder, const nlohmann::json& document);
/// The charts in FOLDER/charts for a page: name of the SVG file -> its content as base64. Empty: none were drawn.
[[nodiscard]] nlohmann::json drawn_charts(const std::string& folder);

}  // namespace narpa::rehearsal
