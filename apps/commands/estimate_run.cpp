#include "apps/commands/estimate_run.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "apps/commands/remade.h"
#include "base/write_file.h"
#include "emulator/log/run_record.h"
#include "tracking/estimate_report.h"
#include "tracking/frame_tracker.h"
#include "tracking/sweep_tracker.h"

namespace narpa::cli {
namespace {

/// Renders the frames again, bit for bit, and tracks the target through them as navigation would.
Result<std::vector<TrackedFrame>> track(const RunEstimate& o, Replay& run, FrameTracker& tracker) {
    std::vector<TrackedFrame> tracked;
    const Status made = each_frame(o, run, [&](std::size_t i) {
        tracked.push_back(tracker.take(run.frames()[i].ledger, run.bytes(), run.placement(i)));
        return Ok{};
    });
    if (!made) return made.error();
    return tracked;
}

LidarSweep decoded(const ReplayedSweep& made, const LidarModel& unit) {
    LidarSweep sweep;
    SweepReader reader(unit);
    for (const ReplayedSweep::Packet& p : made.packets) reader.append(p.bytes, p.t_ns - made.t_ns, sweep);
    return sweep;
}

/// Makes the sweeps again and tracks the target through them.
Result<std::vector<TrackedFrame>> track(const RunEstimate& o, SweepReplay& run, SweepTracker& tracker) {
    std::vector<TrackedFrame> tracked;
    const Status made = each_sweep(o, run, [&](const ReplayedSweep& s) {
        tracked.push_back(tracker.take(s.sweep, s.t_ns, s.t_end_ns, decoded(s, *run.lidar().model)));
    });
    if (!made) return made.error();
    return tracked;
}

Status write_rows(const std::string& path, const std::vector<TrackedFrame>& tracked) {
    std::string rows = std::string(kEstimateHeader) + '\n';
    for (const TrackedFrame& f : tracked) rows += estimate_row(f);
    return write_file(path, rows);
}

Outcome estimate_frames(const RunEstimate& o, const TrackerOptions& options) {
    auto run = Replay::open(o.folder, o.sensor, o.scene);
    if (!run) return run.error();
    auto tracker = FrameTracker::create((*run)->world(), (*run)->camera_index(), options);
    if (!tracker) return tracker.error();
    const auto tracked = track(o, **run, **tracker);
    if (!tracked) return tracked.error();
    const Scene& scene = (*run)->world().scene();
    return report_run(o,
                      {"camera", (*run)->camera().name, scene.bodies[(*tracker)->target()].name,
                       std::string(options.method->name), scene.name, "frame"},
                      *tracked);
}

Outcome estimate_sweeps(const RunEstimate& o, const TrackerOptions& options) {
    if (options.range_guess_m > 0)
        return Error{"a range is guessed for frames, not for a sweep, which measures it", o.folder};
    auto run = SweepReplay::open(o.folder, o.sensor, o.scene);
    if (!run) return run.error();
    auto tracker = SweepTracker::create((*run)->world(), (*run)->lidar_index(), options);
    if (!tracker) return tracker.error();
    const auto tracked = track(o, **run, **tracker);
    if (!tracked) return tracked.error();
    if (tracked->empty())
        return Error{fmt::format("holds no whole sweep of LiDAR \"{}\": expected poses for {:g} s or more",
                                 (*run)->lidar().name, 1 / (*run)->lidar().model->spec().rate_hz),
                     o.folder};
    const Scene& scene = (*run)->world().scene();
    return report_run(
        o, {"lidar", (*run)->lidar().name, scene.bodies[(*tracker)->target()].name, "icp", scene.name, "sweep"},
        *tracked);
}

/// True if the named sensor is a LiDAR of the run's scene. Errors: a name that no sensor has.
Result<bool> is_lidar(const RunEstimate& o) {
    const auto record = read_run_record(o.folder);
    if (!record) return record.error();
    const auto scene = read_run_scene(*record, o.scene);
    if (!scene) return scene.error();
    if (o.sensor.empty()) return scene->cameras.empty();
    std::string names;
    const auto has = [&](const auto& sensors) {
        for (const auto& s : sensors) names += (names.empty() ? "" : ", ") + s.name;
        return std::ranges::any_of(sensors, [&](const auto& s) { return s.name == o.sensor; });
    };
    if (has(scene->cameras)) return false;
    if (has(scene->lidars)) return true;
    return Error{fmt::format("no camera or LiDAR named \"{}\", expected one of: {}", o.sensor, names), scene->file};
}

}  // namespace

Outcome report_run(const RunEstimate& o, const EstimatedRun& of, const std::vector<TrackedFrame>& tracked) {
    const EstimateSummary summary = summarise(tracked);
    say(fmt::format("{}: {} {}, target {}, by {}: {}", o.folder, of.kind, of.sensor, of.target, of.method,
                    to_text(summary, of.item)));
    if (!o.csv.empty())
        if (auto written = write_rows(o.csv, tracked); !written) return written.error();
    if (!o.picture.empty()) {
        const std::string title =
            fmt::format("{}: {} seen by {}, by {}", of.scene, of.target, of.sensor, of.method);
        if (auto written = plot_estimates(o.picture, title, tracked); !written) return written.error();
    }
    for (const std::string& file : {o.csv, o.picture})
        if (!file.empty()) say("wrote " + file);
    return nlohmann::json{{"passed", summary.measured > 0},
                          {"log", o.folder},
                          {of.kind, of.sensor},
                          {"target", of.target},
                          {"method", of.method},
                          {"summary", to_json(summary)}};
}

Outcome estimate_run(const RunEstimate& o, const TrackerOptions& tracker) {
    if (auto made = make_folder_of(o.csv); !made) return made.error();
    if (auto made = make_folder_of_picture(o.picture); !made) return made.error();
    const auto of_sweeps = is_lidar(o);
    if (!of_sweeps) return of_sweeps.error();
    const std::vector<std::string>& others = *of_sweeps ? o.of_frames : o.of_sweeps;
    if (!others.empty())
        return Error{fmt::format("{} goes with {}", others.front(),
                                 *of_sweeps ? "frames, and sweeps of a LiDAR are estimated"
                                            : "sweeps, expected --lidar NAME too"),
                     o.folder};
    return *of_sweeps ? estimate_sweeps(o, tracker) : estimate_frames(o, tracker);
}

}  // namespace narpa::cli
