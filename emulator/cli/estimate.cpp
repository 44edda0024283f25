// narpa estimate - the pose of the target from the frames of a logged run, with covariance, bound and truth.
#include <fmt/format.h>

#include <fstream>

#include "emulator/cli/bench_scene.h"
#include "emulator/cli/cli.h"
#include "emulator/cli/tracker_options.h"
#include "emulator/estimate_report.h"
#include "emulator/replay.h"
#include "emulator/threads.h"

namespace narpa::cli {
namespace {

struct Options {
    std::string folder, camera, scene, csv, picture;
    int every = 1, threads = 0;
    TrackerFlags tracker;
};

/// Frames are made again, bit for bit, and looked at one after another as navigation would.
Result<std::vector<TrackedFrame>> track(const Options& o, Replay& run, FrameTracker& tracker) {
    TracingThreads threads(o.threads);
    const Progress progress;
    std::vector<TrackedFrame> tracked;
    for (std::size_t i = 0; i < run.frames().size(); i += static_cast<std::size_t>(o.every)) {
        progress.tell(fmt::format("frame {}/{}", i, run.frames().size()));
        if (!run.has_image(i)) continue;
        const FrameLedger& ledger = run.frames()[i].ledger;
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
                o.folder + "/" + run.camera().name + ".ledger.csv", run.frames()[i].line};
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

Outcome estimate(const Options& o) {
    auto options = o.tracker.options();
    if (!options) return options.error();
    auto run = Replay::open(o.folder, o.camera, o.scene);
    if (!run) return run.error();
    auto tracker = FrameTracker::create((*run)->world(), (*run)->camera_index(), *options);
    if (!tracker) return tracker.error();
    auto tracked = track(o, **run, **tracker);
    if (!tracked) return tracked.error();
    const Scene& scene = (*run)->world().scene();
    const std::string target = scene.bodies[(*tracker)->target()].name;
    const EstimateSummary summary = summarise(*tracked);
    const nlohmann::json told = to_json(summary);
    say(fmt::format("{}: camera {}, target {}, by {}: {}", o.folder, (*run)->camera().name, target,
                    kEstimateMethods[static_cast<std::size_t>(options->method)], estimates_in_words(told)));
    if (!o.csv.empty())
        if (auto written = write_rows(o.csv, *tracked); !written) return written.error();
    if (!o.picture.empty()) {
        const std::string title = fmt::format("{}: {} seen by {}, by {}", scene.name, target, (*run)->camera().name,
                                              kEstimateMethods[static_cast<std::size_t>(options->method)]);
        if (auto written = plot_estimates(o.picture, title, *tracked); !written) return written.error();
    }
    return nlohmann::json{{"passed", summary.measured > 0},
                          {"log", o.folder},
                          {"camera", (*run)->camera().name},
                          {"target", target},
                          {"method", kEstimateMethods[static_cast<std::size_t>(options->method)]},
                          {"summary", told}};
}

}  // namespace

Command add_estimate(CLI::App& app) {
    auto o = std::make_shared<Options>();
    CLI::App* c = app.add_subcommand(
        "estimate", "Estimate the target's pose from the frames of a logged run, beside the truth and the bound");
    c->add_option("DIR", o->folder, "Folder that `run --log` has written")->required();
    c->add_option("--camera", o->camera, "Name of the camera (default: the first of the scene)");
    c->add_option("--scene", o->scene, "Scene file (default: the one that the run had)");
    o->tracker.add_to(*c, "");
    c->add_option("--every", o->every, "Look at each so-many-th frame")->check(CLI::Range(1, 1000000));
    c->add_option("--threads", o->threads, "Threads (default: all cores)")->check(CLI::Range(0, 1024));
    c->add_option("--csv", o->csv, "FILE.csv: a row for each frame");
    c->add_option("-o,--output", o->picture,
                  "FILE.png: errors over time, with three standard deviations and bound");
    c->footer("Exit status 1 where no frame gave a pose.");
    return [o] { return estimate(*o); };
}

}  // namespace narpa::cli
