// narpa rehearse - runs a scenario in closed loop and checks the result against its limits.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>

#include "apps/cli.h"
#include "apps/commands/rehearsal_text.h"
#include "apps/device_options.h"
#include "apps/scene_argument.h"
#include "apps/slurm.h"
#include "apps/warnings.h"
#include "base/file_bytes.h"
#include "rehearsal/runner/campaign.h"
#include "rehearsal/runner/merge.h"
#include "rehearsal/runner/rehearsal.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

struct RehearseOptions {
    rehearsal::RehearsalOptions run;
    std::vector<std::string> video;
    bool strict = false;
    std::size_t runs = 0;  ///< 0: one, without a summary
    int jobs = 1;
    bool replace = false;
    std::string shard = "1/1";  ///< of the runs
    bool gather = false;        ///< only summarises
    SlurmOptions slurm;
    std::vector<std::string> merge;  ///< campaigns to summarise together; nothing is flown
};

/// True if a line has arrived on standard input.
Result<bool> line_on_stdin() {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (::poll(&input, 1, 0) <= 0) return false;
    char c = 0;
    if (::read(STDIN_FILENO, &c, 1) == 1) return c == '\n';
    return Error{
        "--navigation none: standard input has ended, expected Enter on it once your navigation listens; "
        "--navigation COMMAND needs no input"};
}

rehearsal::Console console(Progress& progress) {
    return {say,
            [&](double share, double left_s, std::string_view text) {
                progress.show({share, std::string(text), left_s});
            },
            line_on_stdin};
}

Outcome one(const rehearsal::RehearsalOptions& options) {
    const auto done = [&] {
        Progress progress("rehearsing");
        progress.show("starting");
        return rehearsal::run_rehearsal(options, console(progress), stop_flag());
    }();
    return print_run(done);
}

Outcome many(const rehearsal::CampaignOptions& options) {
    auto summary = [&] {
        Progress progress("rehearsing");
        progress.show("starting");
        return rehearsal::run_campaign(options, console(progress), stop_flag());
    }();
    return print_campaign(std::move(summary), options.run.folder);
}

Outcome one_shard(const rehearsal::CampaignOptions& options) {
    auto flown = [&] {
        Progress progress("rehearsing");
        progress.show("starting");
        return rehearsal::fly_shard(options, console(progress), stop_flag());
    }();
    if (!flown) return flown;
    say(fmt::format("{}: flew {} of the {} runs of shard {}; {}", options.run.folder, (*flown)["flown"].dump(),
                    (*flown)["runs"].dump(), options.shard.text(),
                    (*flown)["passed"].get<bool>() ? "the others were there" : "some have no result"));
    return flown;
}

/// The summary that the job on the cluster has written.
Outcome gathered(const rehearsal::CampaignOptions& options, int status) {
    const std::string file = options.run.folder + "/summary.json";
    if (status > 1)
        return Error{fmt::format("the job that gathers ended with status {}", status),
                     options.run.folder + "/slurm/gather.log", 0, 0, ErrorKind::failed};
    const auto text = read_file(file);
    if (!text) return text.error();
    nlohmann::json summary = nlohmann::json::parse(*text, nullptr, false);
    if (!summary.is_object()) return Error{"is not a summary", file, 0, 0, ErrorKind::failed};
    return print_campaign(std::move(summary), options.run.folder);
}

/// Submits the runs that are missing.
Outcome on_cluster(const rehearsal::CampaignOptions& options, const SlurmOptions& slurm) {
    const rehearsal::RehearsalOptions& r = options.run;
    if (r.bus != "slcan:0" || !r.video.empty())
        return Error{"--on slurm: runs on other machines have no device of this one, expected no --can or --video"};
    if (auto good = slurm.check(); !good) return good.error();
    if (auto opened = rehearsal::open_campaign(r.folder); !opened) return opened.error();
    if (auto good = check_not_queued(r.folder); !good) return good.error();
    auto plan = rehearsal::plan_campaign(options);
    if (!plan) return plan.error();
    if (plan->missing.empty()) return print_campaign(rehearsal::gather_campaign(options), r.folder);
    const std::uint32_t shards = std::min(static_cast<std::uint32_t>(slurm.max_jobs.value_or(1000)),
                                          static_cast<std::uint32_t>(options.runs));
    SlurmWork work{r.folder,
                   plan->scenario.name,
                   rehearsal::rehearse_arguments(r),
                   r.threads == 0,
                   {},
                   std::move(plan->missing),
                   shards};
    work.part.insert(work.part.end(), {"--runs", std::to_string(options.runs), "-o", r.folder});
    if (r.seed) work.part.insert(work.part.end(), {"--seed", std::to_string(*r.seed)});
    if (options.replace) work.part.emplace_back("--replace");
    work.gather = work.part;
    work.gather.emplace_back("--gather");
    if (r.threads > 0) work.part.insert(work.part.end(), {"--threads", std::to_string(r.threads)});
    const auto jobs = submit_to_slurm(slurm, work);
    if (!jobs) return jobs.error();
    say(submitted_text(*jobs, fmt::format("{} runs", work.missing.size()), r.folder));
    if (!slurm.wait) return to_json(*jobs);
    const auto status = wait_for_slurm(*jobs, r.folder);
    if (!status) return status.error();
    return gathered(options, *status);
}

/// With --strict, the warnings of the scene, which the emulator's log has otherwise, are an Error.
Status warn_of_scene(const rehearsal::Scenario& scenario, bool strict) {
    if (!strict) return Ok{};
    const auto scene = SceneArgument{scenario.scene, scenario.scene_overrides}.load();
    if (!scene) return scene.error();
    return Ok{};
}

Outcome rehearse(const RehearseOptions& given) {
    rehearsal::RehearsalOptions o = given.run;
    if (!given.merge.empty()) {
        if (!o.scenario.empty())
            return Error{fmt::format("--merge flies nothing, expected no scenario beside it, got {}", o.scenario)};
        if (o.folder.empty()) return Error{"--merge: expected a folder for the summary, -o DIR"};
        return print_campaign(rehearsal::merge_campaigns(given.merge, o.folder), o.folder);
    }
    for (const std::string& text : given.video) {
        auto pair = split_pair(text, "CAMERA=DEVICE, like nav=/dev/video10");
        if (!pair) return pair.error();
        o.video.insert(*std::move(pair));
    }
    if (o.scenario.empty()) o.scenario = "docking";
    const auto file = find_file(FileKind::scenario, o.scenario);
    if (!file) return file.error();
    o.scenario = *file;
    auto scenario = rehearsal::read_scenario(o.scenario, o.overrides);
    if (!scenario) return scenario.error();
    if (auto good = warn_of_scene(*scenario, given.strict); !good) return good.error();
    if (auto made = make_folder_of(o.mcap); !made) return made.error();
    if (o.folder.empty()) o.folder = "out/rehearsal/" + scenario->name + (given.runs > 0 ? "-campaign" : "");
    stop_on_signals();
    if (given.runs == 0) return one(o);
    const auto shard = shard_from(given.shard);
    if (!shard) return shard.error();
    const rehearsal::CampaignOptions campaign{o, given.runs, given.jobs, given.replace, *shard};
    if (!given.slurm.on.empty()) return on_cluster(campaign, given.slurm);
    if (given.gather) return print_campaign(rehearsal::gather_campaign(campaign), o.folder);
    return shard->count > 1 ? one_shard(campaign) : many(campaign);
}

}  // namespace

Command add_rehearse(Parser app) {
    auto o = std::make_shared<RehearseOptions>();
    rehearsal::RehearsalOptions& r = o->run;
    r.version = NARPA_VERSION;
    const Parser c = app.subcommand(
        "rehearse", "Fly a scenario with dynamics, emulator and navigation in a closed loop, and apply its gates");
    c.option("SCENARIO", r.scenario, "Scenario file, or a name that `narpa list` shows (default: docking)");
    SceneArgument::add_set_to(c, r.overrides);
    const Option strict = add_strict_to(c);
    c.option(
         "-o,--output", r.folder,
         "Folder for page, verdict, logs (default: out/rehearsal/NAME, of the scenario's name; with --runs "
         "out/rehearsal/NAME-campaign): new, empty, or an earlier run's, which is replaced once all programs have "
         "started")
        .type_name("DIR");
    c.flag("--real-time", r.real_time,
           "In real time, with deadlines (default: in lockstep, the same bytes each time)");
    c.option("--seed", r.seed, "Seed of the dispersions and of all noise (default: the scenario's)");
    const Option runs = c.option("--runs", o->runs,
                                 "Number of runs over the dispersions, run k with seed + k - 1, each in DIR/runs; "
                                 "continues an interrupted campaign, keeps what was flown")
                            .range(1, 100000);
    c.flag("--replace", o->replace,
           "Fly runs of a campaign again that were flown with another scenario or seed (default: refuse)")
        .needs(runs);
    c.option("--merge", o->merge,
             "Fly nothing: summarise the runs of these campaigns of one scenario, of different seeds, together")
        .type_name("DIR")
        .values(1, 10000)
        .excludes(runs);
    c.flag(
        "--lean", r.lean,
        "Of runs that pass keep only records, result and scenario (20 KB in place of 8 MB): in lockstep the seed "
        "repeats the rest");
    c.flag("--keep-frames", r.keep_frames, "Keep the frames that the navigation gets, as emulator/CAMERA.y4m");
    add_mcap_to(c, r.mcap).excludes(runs);
    const Option jobs = c.option("--jobs", o->jobs, "Runs at the same time").range(1, 256).needs(runs);
    const Option shard =
        c.option("--shard", o->shard,
                 "Fly the K-th of M parts of the runs, those whose number - 1 has the remainder K - 1, without a "
                 "summary. Parts may be flown at once, on machines that share the folder")
            .type_name("K/M")
            .needs(runs);
    const Option gather =
        c.flag("--gather", o->gather, "Fly nothing: summarise the runs of DIR that there are").needs(runs);
    gather.excludes(shard);
    o->slurm.add_to(c, "1000").needs(runs).excludes(jobs).excludes(shard).excludes(gather);
    c.option("--can", r.bus,
             "slcan:PORT (0: a free one) | vcan0 | udp:239.74.163.2 | usb:[ADAPTER]; twice: two redundant buses")
        .type_name("BUS")
        .joined_by('+')
        .shows_default();
    c.option("--video", o->video, "A device instead of a FIFO, like nav=/dev/video10; may be given many times")
        .type_name("CAMERA=DEVICE")
        .repeatable();
    c.option("--dynamics", r.dynamics,
             "Command in place of narpa-dynamics, run by sh with SCENARIO, BUS, SEED, LOCKSTEP set; none: you "
             "start it, last")
        .type_name("COMMAND");
    c.option("--navigation", r.navigation,
             "Command in place of narpa-navigation, run by sh with SCENARIO, BUS, VIDEO, LIDAR, SEED, LOCKSTEP "
             "set; writes READY=1 to descriptor READY_FD or prints \"ready\" when it listens, within 10 s; none: "
             "you start it and press Enter")
        .type_name("COMMAND");
    c.option("--threads", r.threads, "Threads of emulator and navigation (default: all cores)").range(0, 1024);
    c.option("--patience", r.patience_s, "Seconds without progress after which the run is ended")
        .type_name("SECONDS")
        .range(1.0, 86400.0)
        .shows_default();
    c.footer("Exit status: 0 all gates passed; 1 one failed; 2 bad input; 3 a device is missing.");
    c.group("Start here");
    c.examples({"narpa rehearse docking -o out/docking", "narpa rehearse realtime --real-time",
                "narpa rehearse dispersions --runs 100 --jobs 2",
                "narpa rehearse dispersions --runs 10000 --on slurm --lean -o /shared/campaign",
                "narpa rehearse docking-camera --navigation 'python3 my_navigation.py $BUS $VIDEO'"});
    return [o, strict] {
        o->strict = strict.given();
        return rehearse(*o);
    };
}

}  // namespace narpa::cli
