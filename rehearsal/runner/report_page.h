/// rehearsal/runner/report_page.h - the report of a rehearsal as one self-contained HTML page.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "rehearsal/judge/bus_record.h"
#include "rehearsal/judge/verdict.h"

namespace narpa::rehearsal {

/// `record` as in rehearsal.json. The pictures of FOLDER/navigation and the charts of FOLDER/charts become part of
/// it.
[[nodiscard]] std::string rehearsal_page(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict,
                                         const nlohmann::json& record, const std::string& folder);

/// The HTML document around the body of a page.
[[nodiscard]] std::string page_around(std::string_view title, std::string_view body);
/// "passed", "failed" as a coloured word.
[[nodiscard]] std::string badge(bool good, std::string_view words);

}  // namespace narpa::rehearsal
