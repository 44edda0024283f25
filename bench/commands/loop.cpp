// narpa bench loop - the real-time loop, alone and beside competing load: jitter, latency, deadlines.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "apps/scene_options.h"
#include "bench/commands/commands.h"
#include "bench/commands/scene.h"
#include "bench/flight.h"
#include "bench/loop.h"
#include "emulator/realtime.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

constexpr int kCpusMax = 1024;

struct LoopBenchOptions {
    SceneArgument scene;
    std::string cpus, plot, trajectory;
    std::optional<double> duration_s;
    std::vector<int> load;
    int busy = 0;  ///< processors to keep busy, where `load` does not name them
    bool idle_only = false;
    double late_max_percent = 0.1;
    BudgetOptions budget;
    RunOptions run;
};

/// `busy` processes, by default one, on the first processors that this process may use, in turn.
Status choose_load(LoopBenchOptions& o) {
    for (const int cpu : o.load)
        if (!parse_cpus(std::to_string(cpu)))
            return Error{fmt::format("--load {}: this processor is not there, or not for this process", cpu)};
    if (!o.load.empty() || o.idle_only) return Ok{};
    std::vector<int> usable;
    for (int cpu = 0; cpu < kCpusMax; ++cpu)
        if (parse_cpus(std::to_string(cpu))) usable.push_back(cpu);
    for (std::size_t i = 0; i < static_cast<std::size_t>(std::max(1, o.busy)); ++i)
        o.load.push_back(usable[i % usable.size()]);
    return Ok{};
}

Result<std::vector<LoopRun>> measure(const LoopBenchOptions& o, const Scene& scene) {
    RunOptions options = o.run;
    for (const Camera& c : scene.cameras) options.video.emplace_back(c.name, "none");
    for (const Lidar& l : scene.lidars) options.lidar.emplace_back(l.name, "none");
    std::vector<LoopRun> runs;
    for (const bool loaded : {false, true}) {
        if ((loaded && o.load.empty()) || stop_flag()) continue;
        const std::string name = loaded ? "loaded" : "idle";
        const auto began = std::chrono::steady_clock::now();
        const Progress progress(fmt::format("real-time loop, {}", name), [&] {
            const std::chrono::duration<double> so_far = std::chrono::steady_clock::now() - began;
            return Step{so_far.count() / options.duration_s, {}};
        });
        auto run = run_loop(name, scene, options, loaded ? o.load : std::vector<int>{}, stop_flag());
        if (!run) return run.error();
        runs.push_back(*std::move(run));
    }
    return runs;
}

/// The trajectory there and back, and its length as duration unless one is set.
Result<std::optional<RecordedFlight>> prepare_flight(LoopBenchOptions& o, const Scene& scene) {
    if (o.duration_s) o.run.duration_s = *o.duration_s;
    if (o.trajectory.empty()) return std::optional<RecordedFlight>{};
    auto rows = read_trajectory(own_or_shipped(o.trajectory));
    if (!rows) return rows.error();
    std::vector<TrajectoryRow> flown = there_and_back(*std::move(rows));
    if (!o.duration_s) o.run.duration_s = std::max(1.0, static_cast<double>(flown.back().t_ns) * 1e-9);
    flown = repeated(std::move(flown), static_cast<std::int64_t>(o.run.duration_s * 1e9));
    auto flight = RecordedFlight::create(scene, o.trajectory, flown);
    if (!flight) return flight.error();
    o.run.bus = flight->bus();
    return std::optional<RecordedFlight>(*std::move(flight));
}

Outcome bench_loop(LoopBenchOptions o) {
    stop_on_signals();
    if (auto good = choose_load(o); !good) return good.error();
    if (!o.cpus.empty()) {
        auto cpus = parse_cpus(o.cpus);
        if (!cpus) return cpus.error();
        o.run.cpus = *std::move(cpus);
    }
    if (auto made = make_folder_of_picture(o.plot); !made) return made.error();
    keep_heap();
    auto scene = scene_or_shipped(o.scene, "docking/docking.toml");
    if (!scene) return scene.error();
    if (scene->cameras.empty()) return Error{"has no camera, expected one at least", scene->file};
    o.budget.override_scene(scene->render);
    auto flight = prepare_flight(o, *scene);
    if (!flight) return flight.error();

    auto runs = measure(o, *scene);
    if (!runs) return runs.error();

    std::vector<std::string> faults = loop_faults(*runs, o.late_max_percent / 100);
    if (stop_flag()) faults.emplace_back("interrupted before the end");
    const std::string load =
        o.load.empty() ? "without load" : fmt::format("load on processors {}", fmt::join(o.load, ", "));
    const std::string title = fmt::format("{}, {:g} s; {}", scene->name, o.run.duration_s, load);
    say(title);
    say(to_text(*runs));
    for (const std::string& fault : faults) say("failed: " + fault);
    if (!o.plot.empty()) {
        if (auto written = plot_loop(o.plot, title, *runs); !written) return written.error();
        say("wrote " + o.plot);
    }

    nlohmann::json of_runs = nlohmann::json::array();
    for (const LoopRun& run : *runs) of_runs.push_back(to_json(run));
    return nlohmann::json{{"passed", faults.empty()},
                          {"faults", faults},
                          {"scene", scene->file},
                          {"duration_s", o.run.duration_s},
                          {"threads", o.run.threads},
                          {"cpus", o.run.cpus},
                          {"late_max_percent", o.late_max_percent},
                          {"runs", of_runs}};
}

}  // namespace

Command add_bench_loop(Parser bench_command) {
    auto o = std::make_shared<LoopBenchOptions>();
    o->run.duration_s = 10;
    const Parser c = bench_command.subcommand(
        "loop", "The real-time loop, alone and under load from other processes: jitter, latency, deadlines");
    c.option("SCENE", o->scene.file, "Scene file (TOML; default: the docking scene that is installed with narpa)");
    o->scene.add_settings_to(c);
    c.option("--duration,--seconds", o->duration_s,
             "Seconds of each of the two runs (default: 10, or the flight of --trajectory)")
        .type_name("SECONDS")
        .range(0.1, 86400.0);
    c.option("--trajectory", o->trajectory,
             "Fly these poses there and back, again until the end, and list the frames by range (CSV, as for narpa "
             "fly)")
        .type_name("FILE.csv");
    const Option load = c.option("--load", o->load, "Processors to keep busy, as 0,1 (default: the first)")
                            .type_name("LIST")
                            .comma_separated();
    const Option busy = c.option("--busy", o->busy, "Number of processes that keep processors busy (default: 1)")
                            .range(1, kCpusMax)
                            .excludes(load);
    c.flag("--idle-only", o->idle_only, "Without the run under load").excludes(load).excludes(busy);
    o->budget.add_to(c);
    c.option("--cpus", o->cpus, "Processors for the threads that trace rays, as 0,1 or 2-3; each is bound to one")
        .type_name("LIST");
    c.option("--threads", o->run.threads, "Threads that trace rays (default: all cores)").range(0, 1024);
    c.option("--late-max", o->late_max_percent, "Percentage of frames that may be late")
        .range(0.0, 100.0)
        .shows_default();
    c.option("-o,--output", o->plot, "How many frames exceed which time").type_name("FILE.png");
    c.footer(
        "Exit status 1 if a frame is incomplete, more frames are late than --late-max, none fell due, or the bench "
        "was interrupted.");
    return [o] { return bench_loop(*o); };
}

}  // namespace narpa::cli
