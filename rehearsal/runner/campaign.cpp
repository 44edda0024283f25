#include "rehearsal/runner/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <thread>
#include <utility>

#include "base/program_beside.h"
#include "base/write_file.h"
#include "rehearsal/report/run_report.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/run_folder.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::chrono::seconds kShowPeriod{1};

json read_json(const std::string& file) {
    json document = json::parse(read_text(file), nullptr, false);
    return document.is_discarded() ? json(nullptr) : document;
}

/// The headline of a failed run's result; its error if it has no result.
std::string failure_of(const std::string& folder, const std::string& log) {
    const json result = read_json(folder + "/result.json");
    return result.is_object() ? result.value("headline", error_in(log)) : error_in(log);
}

std::string run_folder(std::size_t run) {
    return fmt::format("runs/{:04}", run);
}

ChildProcess::Command command_for(const CampaignOptions& o, const std::string& folder, std::uint64_t seed) {
    const RehearsalOptions& r = o.run;
    const int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    const int threads = r.threads > 0 ? r.threads : std::max(1, cores / o.jobs);
    ChildProcess::Command c;
    c.name = "the rehearsal";
    c.line = {(r.programs.empty() ? program_folder().string() : r.programs) + "/narpa",
              "rehearse",
              r.scenario,
              "-o",
              folder,
              "--seed",
              std::to_string(seed),
              "--threads",
              std::to_string(threads),
              "--patience",
              fmt::format("{:g}", r.patience_s)};
    c.line.insert(c.line.end(), {"--can", r.bus});
    for (const std::string& set : r.overrides) c.line.insert(c.line.end(), {"--set", set});
    for (const auto& [camera, device] : r.video) c.line.insert(c.line.end(), {"--video", camera + "=" + device});
    if (r.real_time) c.line.emplace_back("--real-time");
    if (r.keep_frames) c.line.emplace_back("--keep-frames");
    if (r.lean) c.line.emplace_back("--lean");
    if (!r.dynamics.empty()) c.line.insert(c.line.end(), {"--dynamics", r.dynamics});
    if (!r.navigation.empty()) c.line.insert(c.line.end(), {"--navigation", r.navigation});
    c.out = c.err = folder + ".log";
    return c;
}

bool is_interrupted(const json& result) {
    return result.value("trouble", json("")) == "interrupted";
}

/// An Error for the first run that was flown with another scenario or seed.
Status check_flown(const CampaignOptions& o, const Scenario& scenario, const std::string& hash,
                   const std::vector<RunResult>& runs) {
    for (const RunResult& run : runs) {
        const json& result = run.result;
        if (!result.is_object() || is_interrupted(result)) continue;
        const std::string folder = o.run.folder + "/" + run.folder;
        if (result.value("seed", json()) != run.seed)
            return Error{fmt::format("was flown with seed {}, expected {}; --replace flies it again",
                                     result.value("seed", json()).dump(), run.seed),
                         folder};
        if (result.value("scenario_hash", json()) == hash) continue;
        const auto difference = difference_from_flown(folder, scenario);
        if (!difference) return difference.error();
        if (*difference == "[gates]")
            return Error{fmt::format("was flown with other [gates]: `narpa judge {} --gates {}` judges what was "
                                     "flown, --replace flies it again",
                                     o.run.folder, scenario.file),
                         folder};
        return Error{fmt::format("was flown with another scenario ({} differ): expected a new folder, or --replace "
                                 "to fly it again",
                                 difference->empty() ? "[scenario]" : *difference),
                     folder};
    }
    return Ok{};
}

struct Running {
    std::size_t run;
    ChildProcess child;
    std::string log;
    bool asked_to_stop = false;
};

}  // namespace

RunProgress progress_of(const std::string& log) {
    const std::string line = last_line(log), begin = "rehearsing: ";
    double t_s = 0, end_s = 0;
    if (std::sscanf(line.c_str(), "rehearsing: t = %lf s of %*[a-z ] %lf", &t_s, &end_s) != 2 || end_s <= 0)
        return {};
    return {std::clamp(t_s / end_s, 0.0, 1.0), line.substr(begin.size(), line.find(',') - begin.size())};
}

bool is_done(const std::string& folder, const std::string& scenario_hash, std::uint64_t seed) {
    const json result = read_json(folder + "/result.json");
    return result.is_object() && result.value("scenario_hash", json()) == scenario_hash &&
           result.value("seed", json()) == seed && !is_interrupted(result);
}

Result<json> run_campaign(const CampaignOptions& o, const Console& console, const StopFlag& stop) {
    if (o.jobs > 1 && (o.run.bus != "slcan:0" || !o.run.video.empty()))
        return Error{
            fmt::format("--jobs {}: runs at the same time cannot share a bus or a device, expected --jobs 1 "
                        "with --can or --video",
                        o.jobs)};
    if (o.run.dynamics == "none" || o.run.navigation == "none")
        return Error{
            "many runs with a program \"none\" that you start: expected a command that starts it for each run"};
    const auto scenario = read_scenario(o.run.scenario, o.run.overrides);
    if (!scenario) return scenario.error();
    const auto texts = scenario_texts(*scenario);
    if (!texts) return texts.error();
    const auto lock = claim_folder(o.run.folder, FolderKind::campaign);
    if (!lock) return lock.error();
    const std::uint64_t first_seed = o.run.seed.value_or(scenario->seed);
    std::vector<RunResult> runs = campaign_runs(o.run.folder, o.runs, first_seed);
    if (!o.replace)
        if (Status good = check_flown(o, *scenario, texts->hash, runs); !good) return good.error();
    std::error_code failed;
    fs::create_directories(o.run.folder + "/runs", failed);

    const auto folder_of = [&](const RunResult& r) { return o.run.folder + "/" + r.folder; };
    std::size_t next = 0, done = 0;
    std::vector<Running> running;
    const auto show_progress = [&] {
        auto finished = static_cast<double>(done);
        std::string text = fmt::format("{} of {} runs", done, runs.size());
        for (const Running& r : running) {
            const RunProgress p = progress_of(r.log);
            finished += p.share;
            text += fmt::format(", run {}: {}", r.run, p.text.empty() ? "starting" : p.text);
        }
        console.progress(finished / static_cast<double>(runs.size()), -1, text);
    };
    auto shown = std::chrono::steady_clock::now() - kShowPeriod;
    while ((next < runs.size() && !stop) || !running.empty()) {
        while (next < runs.size() && running.size() < static_cast<std::size_t>(o.jobs) && !stop) {
            const RunResult& r = runs[next++];
            if (is_done(folder_of(r), texts->hash, r.seed)) {
                ++done;
                continue;
            }
            fs::remove(folder_of(r) + ".log", failed);
            const ChildProcess::Command command = command_for(o, folder_of(r), r.seed);
            auto child = ChildProcess::start(command);
            if (!child) return child.error();
            running.push_back({r.run, std::move(*child), command.err});
        }
        std::erase_if(running, [&](Running& r) {
            const auto status = r.child.status();
            if (!status) return false;
            ++done;
            if (*status != 0)
                console.print(
                    fmt::format("run {} failed: {}", r.run, failure_of(folder_of(runs[r.run - 1]), r.log)));
            return true;
        });
        if (const auto now = std::chrono::steady_clock::now(); now - shown >= kShowPeriod) {
            shown = now;
            show_progress();
        }
        // Once each: a second request makes a run exit before it has written its results.
        for (Running& r : running)
            if (stop && !std::exchange(r.asked_to_stop, true)) r.child.terminate();
        std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }

    runs = campaign_runs(o.run.folder, o.runs, first_seed);
    for (RunResult& r : runs)
        if (!is_done(folder_of(r), texts->hash, r.seed)) r.result = nullptr;
    return write_summary(o.run.folder, *scenario, runs,
                         {{"scenario_hash", texts->hash}, {"version", o.run.version}});
}

RunResult run_in(const std::string& folder) {
    const json dynamics = read_json(folder + "/dynamics/dynamics.json");
    return {0, 0, folder, read_json(folder + "/result.json"),
            dynamics.is_object() ? dynamics.value("draws", json()) : json()};
}

std::vector<RunResult> campaign_runs(const std::string& folder, std::size_t runs, std::uint64_t first_seed) {
    std::vector<RunResult> all;
    for (std::size_t k = 1; k <= runs; ++k) {
        all.push_back(run_in(folder + "/" + run_folder(k)));
        all.back().run = k;
        all.back().seed = first_seed + k - 1;
        all.back().folder = run_folder(k);
    }
    return all;
}

Result<json> write_summary(const std::string& folder, const Scenario& scenario, const std::vector<RunResult>& runs,
                           const json& facts) {
    json summary = summarise(scenario, runs);
    summary.update(facts);
    std::error_code none;
    for (json& run : summary["each"])  // --lean keeps none of those that pass
        run["page"] = fs::exists(fs::path(folder) / run["folder"].get<std::string>() / "index.html", none);
    if (Status good = write_file(folder + "/junit.xml", campaign_junit(scenario.name, runs)); !good)
        return good.error();
    if (Status good = write_file(folder + "/summary.json", summary.dump(2) + "\n"); !good) return good.error();
    if (Status good = draw_charts(folder, campaign_plot(scenario, contacts_of(runs))); !good) return good.error();
    if (Status good = write_file(folder + "/index.html", campaign_page(scenario, summary, folder)); !good)
        return good.error();
    return summary;
}

}  // namespace narpa::rehearsal
