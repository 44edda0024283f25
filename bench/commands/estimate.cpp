// narpa bench estimate - each estimator: error against its bound, failures, time.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "apps/scene_options.h"
#include "bench/commands/commands.h"
#include "bench/commands/scene.h"
#include "bench/estimation/approach.h"
#include "bench/estimation/cold.h"
#include "bench/estimation/consistency.h"
#include "bench/estimation/consistency_scenes.h"
#include "bench/estimation/filter.h"
#include "bench/estimation/icp.h"
#include "bench/estimation/pnp.h"
#include "bench/estimation/stereo.h"
#include "bench/estimation/untold_errors.h"
#include "bench/statistics.h"
#include "plot/plot.h"

namespace narpa::cli {
namespace {

struct EstimateBenchOptions {
    std::vector<std::string> only;
    std::string plots;    ///< folder; empty: none
    SceneArgument scene;  ///< of the part `approach`
    std::string camera, target;
    std::vector<double> along, up;
    bool quick = false;
    int threads = 0, size = 320;
    double turn_deg_s = 0;
    PnpBenchOptions pnp;
    ApproachOptions approach;
    ConsistencyOptions consistency;
    ColdOptions cold;
    int first_trial = 0;
    std::string model_error, told;
};

/// Results of all parts: what failed, and the points of the summary plot.
struct Findings {
    std::vector<std::string> faults;
    nlohmann::json estimators = nlohmann::json::array();

    /// `ms`: median time of one estimate. `position`: RMS position error, as a fraction of the range.
    void add(const std::string& name, const char* family, double ms, double position) {
        estimators.push_back(
            {{"estimator", name}, {"family", family}, {"ms", ms}, {"position_error_of_range", position}});
    }
};

/// One estimator's part of the bench: prints its results and returns its document.
using Part = Outcome (*)(const EstimateBenchOptions&, Findings&);

/// Writes a plot where --plots was given. `found`: the results of the part.
Status plot(const EstimateBenchOptions& o, const std::string& kind, const std::string& title, const char* key,
            const nlohmann::json& found) {
    if (o.plots.empty()) return Ok{};
    return write_plot(fmt::format("{}/{}.png", o.plots, kind), {{"plot", kind}, {"title", title}, {key, found}});
}

Outcome bench_pnp(const EstimateBenchOptions& o, Findings& findings) {
    Progress progress("pose from points");
    PnpBenchOptions options = o.pnp;
    if (o.quick) options.trials = 20, options.points = {10}, options.ranges_m = {30}, options.hard_cases = false;
    const std::vector<PnpCell> cells = run_pnp_bench(
        options,
        [&](std::size_t done, std::size_t of) {
            progress.show(static_cast<double>(done) / static_cast<double>(of),
                          fmt::format("cell {} of {}", done + 1, of));
        },
        stop_flag());
    const PnpVerdict verdict = judge(cells);
    say(to_text(cells) + to_text(verdict));
    // Times are reported, not judged: the machine may be loaded.
    constexpr double kWorstRms = 1.1;
    if (!o.quick && verdict.worst_rms_bounds > kWorstRms)
        findings.faults.push_back(fmt::format("points: RMS of {:.3f} bounds, expected at most {:g}",
                                              verdict.worst_rms_bounds, kWorstRms));
    for (const PnpCell& cell : cells)
        if (cell.rows.front().trials == 0 && !stop_flag())
            findings.faults.push_back(fmt::format("points: {} of them at {:g} m and {:g} px determine no pose",
                                                  cell.points, cell.range_m, cell.noise_px));
    if (verdict.cells_with_more_failures > 0)
        findings.faults.push_back(fmt::format("points: more failures than {} in {} cells", kPnpPeerCold,
                                              verdict.cells_with_more_failures));
    // The summary plot shows the cell nearest to 30 points, noise of 0.5 px and a range of 30 m.
    const auto distance = [](const PnpCell& c) {
        return std::abs(std::log(c.points / 30.0)) + std::abs(std::log(c.noise_px / 0.5)) +
               std::abs(std::log(c.range_m / 30)) + (c.name == "nominal" ? 0 : 10);
    };
    const auto cell = std::min_element(cells.begin(), cells.end(),
                                       [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
    if (cell != cells.end())
        for (const PnpRow& row : cell->rows)
            findings.add(row.method, "points", 1e-3 * row.median_us,
                         cell->bound_position_of_range * row.position_rms_bounds);
    return nlohmann::json{{"cells", to_json(cells)}, {"verdict", to_json(verdict)}};
}

/// The world of the parts `approach` and `lidar`, with images of this size.
Result<std::unique_ptr<World>> benchmark_world(const SceneArgument& of, int size) {
    auto scene = scene_or_shipped(of, "docking/docking.toml");
    if (!scene) return scene.error();
    for (Camera& c : scene->cameras) resize_longer_side(c, size);
    return World::create(*std::move(scene));
}

Outcome bench_approach(const EstimateBenchOptions& o, Findings& findings) {
    auto world = benchmark_world(o.scene, o.size);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto camera = sensor_named(scene.cameras, o.camera, "camera", scene.file);
    if (!camera) return camera.error();
    const Camera& looking = scene.cameras[*camera];
    const auto meant = target_of(**world, looking.mount, looking.name, o.target);
    if (!meant) return meant.error();
    const std::size_t target = *meant;
    ApproachOptions options = o.approach;
    options.turn_rad_s = o.turn_deg_s * kDegree;
    if (!o.along.empty()) options.along = {o.along[0], o.along[1], o.along[2]};
    if (!o.up.empty()) options.up = {o.up[0], o.up[1], o.up[2]};
    if (!(norm(cross(options.along, options.up)) > 1e-6 * norm(options.along) * norm(options.up)))
        return Error{"--along and --up, expected directions that are not parallel"};
    if (o.quick) options.frames = 4, options.basin = {5}, options.basin_trials = 1;
    TracingThreads threads(o.threads);
    Progress progress("pose from frames");
    const std::vector<ApproachRun> runs = run_approach(
        **world, *camera, target, options, threads, [&](const std::string& step) { progress.show(step); },
        stop_flag());
    say(to_text(runs));
    const std::string title = fmt::format("{}: {} from {:g} m to {:g} m", scene.name, scene.bodies[target].name,
                                          options.from_m, options.to_m);
    const nlohmann::json document = to_json(runs);
    if (auto drawn = plot(o, "approach", title, "runs", document); !drawn) return drawn.error();
    if (!o.plots.empty())
        if (auto drawn = plot_approach_frames(o.plots + "/frames.png", **world, *camera, target, options, threads);
            !drawn)
            return drawn.error();
    for (const ApproachRun& run : runs) {
        Mean position;
        for (const ApproachFrame& f : run.frames)
            if (f.found) position.add(f.position_m / f.range_m);
        const std::string name(run.method->name);
        if (position.count() > 0)
            findings.add(name, "render and compare", run.bands.back().ms_median, position.rms());
    }
    return document;
}

Outcome bench_stereo(const EstimateBenchOptions& o, Findings& findings) {
    auto scene = scene_or_shipped({}, "descent/descent.toml");
    if (!scene) return scene.error();
    Progress progress("stereo");
    const int points = o.quick ? 20 : 100;
    const auto stereo = measure_stereo(*scene, points, [&](const std::string& step) { progress.show(step); });
    if (!stereo) return stereo.error();
    say(to_text(*stereo));
    if (!o.quick)
        for (const std::string& fault : stereo_faults(*stereo, points))
            findings.faults.push_back("stereo: " + fault);
    if (!o.plots.empty())
        if (auto drawn = plot_stereo(o.plots + "/stereo.png", *stereo); !drawn) return drawn.error();
    const double ms = 1e3 * stereo->match_s;
    for (const bool fine : {false, true})
        findings.add(fmt::format("{} points, {} pixels", stereo->points.size(), fine ? "between" : "whole"),
                     "stereo", ms, stereo->errors(fine, 2, true).rms);
    return to_json(*stereo);
}

Outcome bench_icp(const EstimateBenchOptions& o, Findings& findings) {
    auto world = benchmark_world({}, o.size);
    if (!world) return world.error();
    const auto target = (*world)->body_named("station");
    if (!target) return Error{"no body \"station\" in the docking scene", (*world)->scene().file};
    Progress progress("ICP");
    const int count = o.quick ? 10 : 1000;
    const std::vector<IcpStarts> starts{
        {5, 0.05, count}, {10, 0.1, count / 5}, {20, 0.2, count / 5}, {30, 0.3, count / 5}};
    const auto runs = run_icp(**world, *target, starts, [&](int done, int of) {
        progress.show(static_cast<double>(done) / of, fmt::format("start {} of {}", done, of));
    });
    say(to_text(runs));
    findings.add("ICP of a VLP-16 sweep", "LiDAR", 1e-3 * runs.front().microseconds_p50,
                 runs.front().translation_rms_m / (0.5 * (kIcpDistanceMin_m + kIcpDistanceMax_m)));
    nlohmann::json document = to_json(runs);
    if (auto drawn =
            plot(o, "icp", "VLP-16 sweeps of the docking station: starts that found the pose", "runs", document);
        !drawn)
        return drawn.error();
    return document;
}

Outcome bench_filter(const EstimateBenchOptions& o, Findings& findings) {
    FilterBenchSettings settings;
    if (o.quick) settings.runs = 10, settings.seconds = 10;
    const Progress progress("filter");
    const auto runs = run_filter(filter_cases(), settings);
    say(to_text(runs));
    constexpr double kRange_m = 30;  // of the cases
    for (const FilterRun& run : runs)
        findings.add("filter: " + run.name, "filter", 1e-3 * run.update_microseconds,
                     run.times.back().position_rms_m / kRange_m);
    nlohmann::json document = to_json(runs);
    if (auto drawn = plot(o, "filter", "Kalman filter: NEES over time", "runs", document); !drawn)
        return drawn.error();
    return document;
}

Outcome bench_consistency(const EstimateBenchOptions& o, Findings& findings) {
    ConsistencyOptions options = o.consistency;
    auto world = model_uncertainty(o.model_error, "--model-error", &options.distortion);
    if (!world) return world.error();
    auto told = model_uncertainty(o.told, "--told", nullptr);
    if (!told) return told.error();
    options.world = *world, options.told = *told;
    if (o.quick) options.trials = 5;
    TracingThreads threads(o.threads);
    Progress progress("consistency");
    const auto rows = run_consistency(
        options, o.first_trial, threads, [&](const std::string& step) { progress.show(step); }, stop_flag());
    if (!rows) return rows.error();
    say(to_text(*rows));
    int beyond = 0;
    for (const ConsistencyRow& row : *rows) beyond += row.beyond;
    if (beyond > 0) findings.faults.push_back(fmt::format("consistency: {} good answers beyond 6 sigma", beyond));
    return to_json(*rows);
}

Outcome bench_cold(const EstimateBenchOptions& o, Findings& findings) {
    auto docking = scene_or_shipped({}, "docking/docking.toml");
    if (!docking) return docking.error();
    ColdOptions options = o.cold;
    if (o.quick) options.trials = 3;
    TracingThreads threads(o.threads);
    Progress progress("cold start");
    const auto trials = run_cold(
        options, *docking, o.first_trial, threads,
        [&](const ColdTrial& t) {
            progress.show(fmt::format("trial {}: {}: {}", t.number, t.target,
                                      kAnswerKinds[static_cast<std::size_t>(t.answer)]));
        },
        stop_flag());
    if (!trials) return trials.error();
    say(to_text(*trials));
    const auto wrong = std::ranges::count_if(*trials, &ColdTrial::wrong);
    if (wrong > 0) findings.faults.push_back(fmt::format("cold: {} good answers are wrong", wrong));
    return to_json(*trials);
}

constexpr std::pair<const char*, Part> kParts[] = {
    {"pnp", bench_pnp},       {"approach", bench_approach},       {"stereo", bench_stereo}, {"icp", bench_icp},
    {"filter", bench_filter}, {"consistency", bench_consistency}, {"cold", bench_cold}};

Outcome bench_estimates(const EstimateBenchOptions& o) {
    stop_on_signals();
    if (!o.scene.sets.empty() && !o.only.empty() && std::ranges::find(o.only, "approach") == o.only.end())
        return Error{"--set changes the scene of the part approach, which --only leaves out"};
    if (!o.plots.empty()) {
        std::error_code error;
        std::filesystem::create_directories(o.plots, error);
        if (error) return Error{"cannot be made a folder: " + error.message(), o.plots};
    }
    Findings findings;
    nlohmann::json document;
    for (const auto& [name, part] : kParts) {
        const bool wanted = o.only.empty() || std::find(o.only.begin(), o.only.end(), name) != o.only.end();
        if (!wanted || stop_flag()) continue;
        auto done = part(o, findings);
        if (!done) return done.error();
        document[name] = *std::move(done);
    }
    document["time_and_error"] = findings.estimators;
    if (!o.plots.empty())
        if (auto drawn = write_plot(o.plots + "/time_error.png",
                                    {{"plot", "estimators"}, {"estimators", findings.estimators}});
            !drawn)
            return drawn.error();
    if (!o.plots.empty()) say("wrote plots to " + o.plots);
    if (stop_flag()) findings.faults.emplace_back("interrupted before the end");
    for (const std::string& fault : findings.faults) say("failed: " + fault);
    document["passed"] = findings.faults.empty();
    document["faults"] = findings.faults;
    return document;
}

}  // namespace

Command add_bench_estimate(Parser bench_command) {
    auto o = std::make_shared<EstimateBenchOptions>();
    const Parser c = bench_command.subcommand(
        "estimate", "Estimators of the relative pose: error against the Cramer-Rao bound, failures, time");
    std::vector<std::string> names;
    for (const auto& [name, part] : kParts) names.emplace_back(name);
    c.option("--only", o->only, fmt::format("Only these parts, separated by commas: {}", fmt::join(names, ", ")))
        .comma_separated()
        .one_of(names)
        .type_name("LIST");
    c.option("--trials", o->pnp.trials, "pnp: draws of each cell").range(1, 1'000'000).shows_default();
    c.option("--points", o->pnp.points, "pnp: numbers of points").comma_separated().range(4, 1000);
    c.option("--noise-px", o->pnp.noise_px, "pnp: standard deviations of a pixel")
        .comma_separated()
        .range(1e-6, 100.0);
    c.option("--ranges", o->pnp.ranges_m, "pnp: metres to the body").comma_separated().range(1.0, 1e6);
    const Option nominal = c.flag("!--nominal-only", o->pnp.hard_cases, "pnp: no hard cases");
    c.flag("!--hard-only", o->pnp.nominal, "pnp: only the hard cases").excludes(nominal);
    c.option("--seed", o->pnp.seed, "pnp: of all draws").shows_default();
    c.option("--scene", o->scene.file,
             "approach: scene file (default: the docking scene that is installed with narpa)")
        .type_name("SCENE");
    o->scene.add_settings_to(c);
    c.option("--camera", o->camera, "approach: name of the camera (default: the first)").type_name("NAME");
    c.option("--target", o->target, "approach: name of the body (default: the first that it can be)")
        .type_name("BODY");
    c.option("--size", o->size, "approach: pixels of the camera's longer side").range(32, 10'000).shows_default();
    c.option("--frames", o->approach.frames, "approach: frames").range(2, 100'000);
    c.option("--from", o->approach.from_m, "approach: m from the target's origin").range(0.01, 1e7);
    c.option("--to", o->approach.to_m, "approach: m from the target's origin").range(0.01, 1e7);
    c.option("--along", o->along, "approach: from the target towards the camera, target axes")
        .type_name("X,Y,Z")
        .comma_separated()
        .values(3, 3);
    c.option("--up", o->up, "approach: what is up in the picture, target axes")
        .type_name("X,Y,Z")
        .comma_separated()
        .values(3, 3);
    c.option("--turn", o->turn_deg_s, "approach: deg/s that the camera turns, where the scene gives it a shutter")
        .range(0.0, 100.0);
    c.option("--speed", o->approach.speed_m_s, "approach: m/s that it passes the target, likewise").range(0.0, 1e4);
    c.option("--ignore", o->approach.ignored,
             fmt::format("approach: what the estimators do not know of the camera, separated by commas: {}",
                         fmt::join(kIgnorable, ", ")))
        .comma_separated()
        .one_of({kIgnorable.begin(), kIgnorable.end()})
        .type_name("LIST");
    c.option("--frame-spp", o->approach.frame_spp, "approach: samples a pixel of the frames").range(1, 65'536);
    c.option("--basin-trials", o->approach.basin_trials, "approach: starts of each distance; 0: none")
        .range(0, 100'000);
    c.option("--basin-range", o->approach.basin_range_m, "approach: m, where starts far off are tried")
        .range(0.01, 1e7);
    c.option("--consistency-trials", o->consistency.trials,
             "consistency: frames, sweeps or sets of points of each method")
        .range(1, 1'000'000)
        .shows_default();
    c.option("--methods", o->consistency.methods,
             fmt::format("consistency: {}", fmt::join(kConsistencyMethods, ", ")))
        .comma_separated()
        .one_of({kConsistencyMethods.begin(), kConsistencyMethods.end()})
        .type_name("LIST");
    c.option("--consistency-size", o->consistency.size, "consistency: pixels of the camera's sides")
        .range(32, 10'000)
        .shows_default();
    const auto targets = consistency_targets();
    c.option("--targets", o->consistency.targets,
             fmt::format("consistency: {} (default: all of these), or scene files (.toml), whose first body it is",
                         fmt::join(targets, ", ")))
        .comma_separated()
        .type_name("LIST");
    c.option("--conditions", o->consistency.conditions,
             fmt::format("consistency: {} (default: all)", fmt::join(kConsistencyConditions, ", ")))
        .comma_separated()
        .one_of({kConsistencyConditions.begin(), kConsistencyConditions.end()})
        .type_name("LIST");
    std::vector<std::string> untold{"all"};
    for (const UntoldError& e : untold_errors()) untold.emplace_back(e.name);
    c.option("--untold", o->consistency.untold,
             fmt::format("consistency: instead of conditions, errors of the world that dense and features are not "
                         "told of: {}; none: frames without error of which dense is not told the noise",
                         fmt::join(untold, ", ")))
        .comma_separated()
        .one_of(untold)
        .type_name("LIST");
    c.option("--first-trial", o->first_trial, "consistency: number of the first").range(0, 1'000'000'000);
    c.option("--model-error", o->model_error,
             "consistency: errors of the believed model, standard deviations (docs/estimation-accuracy.md)")
        .type_name("NAME=VALUE,...");
    c.option("--told", o->told, "consistency: what the estimators are told of it").type_name("NAME=VALUE,...");
    c.option("--cold-trials", o->cold.trials, "cold: frames").range(1, 1'000'000).shows_default();
    c.option(
         "--cold-targets", o->cold.targets,
         fmt::format("cold: station, {} (default: {})", fmt::join(targets, ", "), fmt::join(o->cold.targets, ", ")))
        .comma_separated()
        .type_name("LIST");
    c.option("--cold-size", o->cold.size, "cold: pixels of the camera's longer side")
        .range(32, 10'000)
        .shows_default();
    c.flag("!--cold-noise-unknown", o->cold.noise_known,
           "cold: the search does not know the frames' sampling noise");
    c.flag("--quick", o->quick, "Few draws of all, to see that it works");
    c.option("--threads", o->threads, "Threads (default: all cores)").range(0, 1024);
    c.option("-o,--output", o->plots, "Folder for plots: of each part, and of time against error").type_name("DIR");
    c.footer(
        "Exit status 1 where points or stereo are less exact than they must be, a good answer is wrong, or the "
        "bench was interrupted.");
    return [o] { return bench_estimates(*o); };
}

}  // namespace narpa::cli
