// narpa estimate - the pose of the target from the frames of a logged run, or from one frame or sweep in a file,
// with covariance, bound and truth.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "apps/bench_scene.h"
#include "apps/cli.h"
#include "apps/estimate_one.h"
#include "apps/tracker_options.h"
#include "emulator/log/estimate_report.h"
#include "emulator/replay/replay.h"
#include "emulator/threads.h"

namespace narpa::cli {
namespace {

struct Options {
    std::string input, camera, scene, csv, picture;
    int every = 1;
    TrackerFlags tracker;
    OneOptions one;  ///< of a single file
    std::vector<Option> only_of_files, only_of_logs;
};

/// Renders the frames again, bit for bit, and tracks the target through them as navigation would.
Result<std::vector<TrackedFrame>> track(const Options& o, Replay& run, FrameTracker& tracker) {
    TracingThreads threads(o.one.threads);
    const Progress progress;
    std::vector<TrackedFrame> tracked;
    for (std::size_t i = 0; i < run.frames().size(); i += static_cast<std::size_t>(o.every)) {
        progress.tell(fmt::format("frame {}/{}", i, run.frames().size()));
        const FrameLedger& ledger = run.frames()[i].ledger;
        if (!run.has_image(i) || ledger.delivery != Delivery::frame) continue;
        std::vector<std::string> differs;
        threads.arena.execute([&] {
            differs = run.make(i);
            tracked.push_back(tracker.take(ledger.frame, ledger.t_exposure_mid_ns, run.bytes(), run.placement(i)));
        });
        if (!differs.empty())
            return Error{
                fmt::format("frame {} is not the run's any more: {}; expected the scene and the program as they "
                            "were",
                            ledger.frame, differs.front()),
                o.input + "/" + run.camera().name + ".ledger.csv", run.frames()[i].line};
    }
    return tracked;
}

Status write_rows(const std::string& path, const std::vector<TrackedFrame>& tracked) {
    std::ofstream file(path);
    file << kEstimateHeader << '\n';
    for (const TrackedFrame& f : tracked) file << estimate_row(f);
    file.flush();
    if (!file) return Error{"cannot be written", path};
    return Ok{};
}

Outcome estimate_log(const Options& o, const TrackerOptions& tracker_options) {
    auto run = Replay::open(o.input, o.camera, o.scene);
    if (!run) return run.error();
    auto tracker = FrameTracker::create((*run)->world(), (*run)->camera_index(), tracker_options);
    if (!tracker) return tracker.error();
    auto tracked = track(o, **run, **tracker);
    if (!tracked) return tracked.error();
    const Scene& scene = (*run)->world().scene();
    const std::string target = scene.bodies[(*tracker)->target()].name;
    const EstimateSummary summary = summarise(*tracked);
    const nlohmann::json told = to_json(summary);
    say(fmt::format("{}: camera {}, target {}, by {}: {}", o.input, (*run)->camera().name, target,
                    kEstimateMethods[static_cast<std::size_t>(tracker_options.method)], in_words(summary)));
    if (!o.csv.empty())
        if (auto written = write_rows(o.csv, *tracked); !written) return written.error();
    if (!o.picture.empty()) {
        const std::string title = fmt::format("{}: {} seen by {}, by {}", scene.name, target, (*run)->camera().name,
                                              kEstimateMethods[static_cast<std::size_t>(tracker_options.method)]);
        if (auto written = plot_estimates(o.picture, title, *tracked); !written) return written.error();
    }
    return nlohmann::json{{"passed", summary.measured > 0},
                          {"log", o.input},
                          {"camera", (*run)->camera().name},
                          {"target", target},
                          {"method", kEstimateMethods[static_cast<std::size_t>(tracker_options.method)]},
                          {"summary", told}};
}

Outcome estimate(const Options& o) {
    auto tracker = o.tracker.options();
    if (!tracker) return tracker.error();
    std::error_code error;
    const bool of_log = std::filesystem::is_directory(o.input, error);
    for (const Option& option : of_log ? o.only_of_files : o.only_of_logs)
        if (option.given())
            return Error{fmt::format("{} goes with {}", option.name(),
                                     of_log ? "a scene file, and this is a folder" : "the folder of a logged run"),
                         o.input};
    if (of_log) return estimate_log(o, *tracker);
    OneOptions one = o.one;
    one.scene = o.input;
    one.sensor = o.camera;
    one.tracker = *tracker;
    if (!std::filesystem::exists(o.input, error))
        return Error{"is not there, expected the folder of a logged run or a scene file", o.input};
    if (one.frame.empty() == one.sweep.empty())
        return Error{"with a scene, expected one of --frame FILE.raw and --sweep FILE.pcap", o.input};
    return one.frame.empty() ? estimate_sweep(one) : estimate_frame(one);
}

}  // namespace

Command add_estimate(Parser app) {
    auto o = std::make_shared<Options>();
    const Parser c = app.subcommand("estimate",
                                    "Estimate the target's pose from a logged run, a frame or a sweep, and compare "
                                    "with the truth and the bound");
    c.option("INPUT", o->input, "Folder that `run --log` has written, or a scene file with --frame or --sweep")
        .required();
    c.option("--camera,--lidar", o->camera, "Name of the camera or LiDAR (default: the first of the scene)");
    c.option("--frame", o->one.frame,
             "FILE.raw: a frame's bytes as the device takes them, as `render` writes them");
    c.option("--sweep", o->one.sweep, "FILE.pcap: the LiDAR's data packets, from the first on for one turn");
    c.option("--time", o->one.time_s, "Simulation time of the frame or the sweep's first shot, s")
        .range(-9e9, 9e9)
        .finite();
    c.option("--range-noise", o->one.range_noise_m, "Standard deviation of the sweep's ranges, m")
        .range(1e-6, 1e3)
        .shows_default();
    o->one.pose.add_to(c);
    c.option("--scene", o->scene, "Scene file (default: the run's)");
    o->tracker.add_to(c, "");
    c.option("--every", o->every, "Use every N-th frame").range(1, 1000000);
    c.option("--threads", o->one.threads, "Threads (default: all cores)").range(0, 1024);
    c.option("--csv", o->csv, "FILE.csv: a row for each frame");
    c.option("-o,--output", o->picture, "FILE.png: errors over time, with three standard deviations and bound");
    for (const char* name : {"--frame", "--sweep", "--time", "--range-noise", "--pose", "--trajectory"})
        o->only_of_files.push_back(c.find(name));
    for (const char* name : {"--scene", "--every", "--csv", "--output"}) o->only_of_logs.push_back(c.find(name));
    c.footer("Exit status 1 if no frame gave a pose, or a sweep's pose is not credible.");
    return [o] { return estimate(*o); };
}

}  // namespace narpa::cli
