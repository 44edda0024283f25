#include "rehearsal/runner/run_results.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <nlohmann/json.hpp>

#include "base/write_file.h"
#include "rehearsal/report/run_report.h"

namespace narpa::rehearsal {

Status write_whole(const std::string& file, const std::string& text) {
    errno = 0;
    Status written = write_file(file, text);
    if (written || errno == 0) return written;
    return Error{fmt::format("cannot be written: {}", std::strerror(errno)), file, 0, 0, ErrorKind::failed};
}

void keep_first(Status& first, const Status& next) {
    if (first && !next) first = next;
}

RehearsalResult write_results(const Scenario& scenario, const Judge& judge, const nlohmann::json& record,
                              const std::string& folder, Pages pages) {
    const auto in_folder = [&](const char* name) { return folder + "/" + name; };
    RehearsalResult done;
    const auto trouble = record["trouble"].get<std::string>();
    done.wall_s = record["wall_s"];
    done.verdict = judge.finish(trouble);
    const Verdict& v = done.verdict;
    done.result = to_json(v);
    done.result.update({{"scenario", scenario.name},
                        {"scenario_hash", record["scenario_hash"]},
                        {"seed", record["seed"]},
                        {"version", record["version"]},
                        {"trouble", trouble}});
    if (record.contains("judged_by")) done.result["judged_by"] = record["judged_by"];
    // The verdict is written first: on a full disk the rest may have no room.
    keep_first(done.written, write_whole(in_folder("result.json"), done.result.dump(2) + "\n"));
    keep_first(done.written, write_whole(in_folder("junit.xml"), junit(v, scenario.name, done.wall_s)));
    if (pages == Pages::none || (pages == Pages::of_failed && v.passed)) return done;
    keep_first(done.written, draw_charts(folder, rehearsal_plot(scenario, judge.bus(), v)));
    const Status paged =
        write_whole(in_folder("index.html"), rehearsal_page(scenario, judge.bus(), v, record, folder));
    if (paged) done.page = in_folder("index.html");
    keep_first(done.written, paged);
    return done;
}

}  // namespace narpa::rehearsal
