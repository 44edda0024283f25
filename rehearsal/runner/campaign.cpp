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
    c.line = rehearse_arguments(r);
    c.line.insert(c.line.begin(), (r.programs.empty() ? program_folder().string() : r.programs) + "/narpa");
    c.line.insert(c.line.end(),
                  {"-o", folder, "--seed", std::to_string(seed), "--threads", std::to_string(threads)});
    c.out = c.err = folder + ".log";
    return c;
}

bool is_interrupted(const json& result) {
    return result.value("trouble", json("")) == "interrupted";
}

bool is_result_of(const json& result, const std::string& scenario_hash, std::uint64_t seed) {
    return result.is_object() && result.value("scenario_hash", json()) == scenario_hash &&
           result.value("seed", json()) == seed && !is_interrupted(result);
}

Status check_options(const CampaignOptions& o) {
    if ((o.jobs > 1 || o.shard.count > 1) && (o.run.bus != "slcan:0" || !o.run.video.empty()))
        return Error{fmt::format(
            "{}: runs at the same time cannot share a bus or a device, expected --jobs 1 with --can or --video",
            o.jobs > 1 ? fmt::format("--jobs {}", o.jobs) : "--shard " + o.shard.text())};
    if (o.run.dynamics == "none" || o.run.navigation == "none")
        return Error{
            "many runs with a program \"none\" that you start: expected a command that starts it for each run"};
    return Ok{};
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

/// Flies the missing runs of a plan, `jobs` at a time.
Status fly(const CampaignOptions& o, const CampaignPlan& plan, const Console& console, const StopFlag& stop) {
    std::error_code failed;
    fs::create_directories(o.run.folder + "/runs", failed);
    const auto folder_of = [&](std::size_t run) { return o.run.folder + "/" + run_folder(run); };
    const std::uint64_t first_seed = plan.runs.empty() ? 0 : plan.runs.front().seed - (plan.runs.front().run - 1);
    std::size_t next = 0, done = plan.runs.size() - plan.missing.size();
    std::vector<Running> running;
    const auto show_progress = [&] {
        auto finished = static_cast<double>(done);
        std::string text = fmt::format("{} of {} runs", done, plan.runs.size());
        for (const Running& r : running) {
            const RunProgress p = progress_of(r.log);
            finished += p.share;
            text += fmt::format(", run {}: {}", r.run, p.text.empty() ? "starting" : p.text);
        }
        console.progress(finished / static_cast<double>(plan.runs.size()), -1, text);
    };
    auto shown = std::chrono::steady_clock::now() - kShowPeriod;
    while ((next < plan.missing.size() && !stop) || !running.empty()) {
        while (next < plan.missing.size() && running.size() < static_cast<std::size_t>(o.jobs) && !stop) {
            const std::size_t run = plan.missing[next++] + std::size_t{1};
            fs::remove(folder_of(run) + ".log", failed);
            const ChildProcess::Command command = command_for(o, folder_of(run), first_seed + run - 1);
            auto child = ChildProcess::start(command);
            if (!child) return child.error();
            running.push_back({run, std::move(*child), command.err});
        }
        std::erase_if(running, [&](Running& r) {
            const auto status = r.child.status();
            if (!status) return false;
            ++done;
            if (*status != 0)
                console.print(fmt::format("run {} failed: {}", r.run, failure_of(folder_of(r.run), r.log)));
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
    return Ok{};
}

Result<json> summarise_folder(const CampaignOptions& o) {
    const auto plan = plan_campaign(o);
    if (!plan) return plan.error();
    return write_summary(o.run.folder, plan->scenario, plan->runs,
                         {{"scenario_hash", plan->scenario_hash}, {"version", o.run.version}});
}

}  // namespace

RunProgress progress_of(const std::string& log) {
    const std::string line = last_line(log), begin = "rehearsing: ";
    double t_s = 0, end_s = 0;
    if (std::sscanf(line.c_str(), "rehearsing: t = %lf s of %*[a-z ] %lf", &t_s, &end_s) != 2 || end_s <= 0)
        return {};
    return {std::clamp(t_s / end_s, 0.0, 1.0), line.substr(begin.size(), line.find(',') - begin.size())};
}

bool is_done(const std::string& folder, const std::string& scenario_hash, std::uint64_t seed) {
    return is_result_of(read_json(folder + "/result.json"), scenario_hash, seed);
}

Result<CampaignPlan> plan_campaign(const CampaignOptions& o) {
    if (Status good = check_options(o); !good) return good.error();
    auto scenario = read_scenario(o.run.scenario, o.run.overrides);
    if (!scenario) return scenario.error();
    const auto texts = scenario_texts(*scenario);
    if (!texts) return texts.error();
    const std::uint64_t first_seed = o.run.seed.value_or(scenario->seed);
    CampaignPlan plan{*std::move(scenario), texts->hash, campaign_runs(o.run.folder, o.runs, first_seed, o.shard)};
    if (!o.replace)
        if (Status good = check_flown(o, plan.scenario, plan.scenario_hash, plan.runs); !good) return good.error();
    for (RunResult& r : plan.runs) {
        if (is_result_of(r.result, plan.scenario_hash, r.seed)) continue;
        r.result = nullptr;
        plan.missing.push_back(static_cast<std::uint32_t>(r.run - 1));
    }
    return plan;
}

Result<json> run_campaign(const CampaignOptions& o, const Console& console, const StopFlag& stop) {
    if (Status good = check_options(o); !good) return good.error();
    const auto lock = claim_folder(o.run.folder, FolderKind::campaign);
    if (!lock) return lock.error();
    const auto plan = plan_campaign(o);
    if (!plan) return plan.error();
    if (Status flown = fly(o, *plan, console, stop); !flown) return flown.error();
    return summarise_folder(o);
}

Status open_campaign(const std::string& folder) {
    const auto lock = claim_folder(folder, FolderKind::campaign, Lock::shared);
    if (!lock) return lock.error();
    std::error_code failed;
    fs::create_directories(folder + "/runs", failed);
    if (failed) return Error{"cannot be made: " + failed.message(), folder + "/runs", 0, 0, ErrorKind::missing};
    return Ok{};
}

Result<json> fly_shard(const CampaignOptions& o, const Console& console, const StopFlag& stop) {
    const auto lock = claim_folder(o.run.folder, FolderKind::campaign, Lock::shared);
    if (!lock) return lock.error();
    const auto plan = plan_campaign(o);
    if (!plan) return plan.error();
    if (Status flown = fly(o, *plan, console, stop); !flown) return flown.error();
    const auto after = plan_campaign(o);
    if (!after) return after.error();
    return json{{"runs", plan->runs.size()},
                {"flown", plan->missing.size() - after->missing.size()},
                {"passed", after->missing.empty()}};
}

Result<json> gather_campaign(const CampaignOptions& o) {
    const auto lock = claim_folder(o.run.folder, FolderKind::campaign, Lock::shared);
    if (!lock) return lock.error();
    return summarise_folder(o);
}

std::vector<std::string> rehearse_arguments(const RehearsalOptions& r) {
    std::vector<std::string> a{"rehearse", r.scenario, "--patience", fmt::format("{:g}", r.patience_s),
                               "--can",    r.bus};
    for (const std::string& set : r.overrides) a.insert(a.end(), {"--set", set});
    for (const auto& [camera, device] : r.video) a.insert(a.end(), {"--video", camera + "=" + device});
    if (r.real_time) a.emplace_back("--real-time");
    if (r.keep_frames) a.emplace_back("--keep-frames");
    if (r.lean) a.emplace_back("--lean");
    if (!r.dynamics.empty()) a.insert(a.end(), {"--dynamics", r.dynamics});
    if (!r.navigation.empty()) a.insert(a.end(), {"--navigation", r.navigation});
    return a;
}

RunResult run_in(const std::string& folder) {
    const json dynamics = read_json(folder + "/dynamics/dynamics.json");
    return {0, 0, folder, read_json(folder + "/result.json"),
            dynamics.is_object() ? dynamics.value("draws", json()) : json()};
}

std::vector<RunResult> campaign_runs(const std::string& folder, std::size_t runs, std::uint64_t first_seed,
                                     const Shard& shard) {
    std::vector<RunResult> all;
    for (std::size_t k = shard.index + std::size_t{1}; k <= runs; k += shard.count) {
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
