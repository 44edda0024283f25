/// rehearsal/runner/run_results.h - the files that state the result of a run.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "rehearsal/judge/judge.h"
#include "rehearsal/runner/rehearsal.h"

namespace narpa::rehearsal {

/// write_file, with the system's reason in the Error.
[[nodiscard]] Status write_whole(const std::string& file, const std::string& text);
void keep_first(Status& first, const Status& next);

/// Which runs get charts and a page.
enum class Pages : std::uint8_t { none, of_failed, all };

/// Writes result.json, junit.xml and, by `pages`, charts and index.html into the run's folder. `record`: that of
/// rehearsal.json, with "wall_s" and "trouble".
[[nodiscard]] RehearsalResult write_results(const Scenario& scenario, const Judge& judge,
                                            const nlohmann::json& record, const std::string& folder, Pages pages);

}  // namespace narpa::rehearsal
