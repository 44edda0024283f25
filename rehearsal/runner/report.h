/// rehearsal/runner/report.h - the report of a rehearsal as one self-contained HTML page, its charts, and the HTML
/// parts that it shares with a campaign's.
#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// `record` as in rehearsal.json. Embeds the pictures of FOLDER/navigation and the charts of FOLDER/charts.
[[nodiscard]] std::string rehearsal_page(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict,
                                         const nlohmann::json& record, const std::string& folder);

/// Documents for narpa-plot (plot/plot.h). Lengths in m, times in s of the scenario. `contacts`: the "contact"
/// objects of result.json, one for each run that made contact.
[[nodiscard]] nlohmann::json rehearsal_plot(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict);
[[nodiscard]] nlohmann::json campaign_plot(const Scenario& scenario, std::span<const nlohmann::json> contacts);
/// Writes the document as FOLDER/charts.json and has its charts drawn into FOLDER/charts.
[[nodiscard]] Status draw_charts(const std::string& folder, const nlohmann::json& document);

struct PageChart {
    std::string_view name, title;  ///< file name without .svg; text for people who cannot see it
};
/// The existing charts among those in FOLDER/charts. If there is none, a sentence on how to draw them.
[[nodiscard]] std::string charts_of(const std::string& folder, std::initializer_list<PageChart> charts);

/// The HTML document around the body of a page.
[[nodiscard]] std::string page_around(std::string_view title, std::string_view body);
/// "passed", "failed" as a coloured word.
[[nodiscard]] std::string badge(bool good);

/// An HTML table; cells are HTML. Titles of columns of numbers begin with '#'.
class HtmlTable {
public:
    HtmlTable(std::initializer_list<std::string_view> titles);
    void row(std::initializer_list<std::string> cells);
    [[nodiscard]] std::string html() const { return rows_ + "</table>\n"; }

private:
    std::vector<bool> numbers_;
    std::vector<std::string> titles_;  ///< shown beside each cell on a narrow page
    std::string rows_ = "<table>";
};

}  // namespace narpa::rehearsal
