// narpa estimate - the pose of the target from the frames or sweeps of a logged run, or from files, with
// covariance, bound and truth.
#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "apps/cli.h"
#include "apps/commands/estimate_batch.h"
#include "apps/commands/estimate_file.h"
#include "apps/commands/estimate_run.h"
#include "apps/commands/estimate_stereo.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "apps/warnings.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

struct EstimateOptions {
    std::string input;
    std::vector<std::string> sets;  ///< of the scene
    TrackerFlags tracker;
    RunEstimate run;  ///< of a logged run; its threads hold for a file too
    BatchSensors sensors;
    BatchFlags batch;
    StereoFlags stereo;
    FileEstimate file;

    std::vector<Option> only_of_files, only_of_logs, only_of_frames, only_of_sweeps, only_of_batches,
        only_of_stereo, not_of_stereo;
};

/// An Error that names the first of these options that was given.
Status none_given(const std::vector<Option>& options, const std::string& why, const std::string& file = {}) {
    for (const Option& option : options)
        if (option.given()) return Error{fmt::format("{} {}", option.name(), why), file};
    return Ok{};
}

Status check_stereo_flags(const EstimateOptions& o) {
    if (!o.stereo.on()) return none_given(o.only_of_stereo, "goes with --stereo LEFT,RIGHT");
    return none_given(o.not_of_stereo, "does not go with --stereo, which names the cameras");
}

Outcome estimate_file(EstimateOptions o, const TrackerOptions& tracker) {
    FileEstimate& f = o.file;
    f.scene = o.input, f.sets = o.sets, f.threads = o.run.threads, f.sensor = o.run.sensor;
    if (tracker.range_guess_m > 0 && !f.sweep.empty())
        return Error{"a range is guessed for frames, not for a sweep, which measures it"};
    if (f.frames.empty() && f.sweep.empty() && !find_file(FileKind::scene, o.input))
        return Error{
            "no such folder, expected that of a logged run or rehearsal, or a scene with --frame FILE or "
            "--sweep FILE.pcap",
            o.input};
    if (f.frames.empty() == f.sweep.empty())
        return Error{"with a scene, expected one of --frame FILE and --sweep FILE.pcap", o.input};
    const bool of_sweep = f.frames.empty();
    if (auto good = none_given(
            of_sweep ? o.only_of_frames : o.only_of_sweeps,
            of_sweep ? "goes with a frame, and this is a sweep" : "goes with a sweep, and this is a frame",
            of_sweep ? f.sweep : f.frames.front());
        !good)
        return good.error();
    if (o.stereo.on()) return estimate_stereo_frames(f, o.stereo, tracker);
    if (f.frames.size() > 1) return Error{"one camera has one --frame, expected --stereo LEFT,RIGHT for two"};
    return of_sweep ? estimate_sweep(f, tracker) : estimate_frame(f, tracker);
}

Outcome estimate(EstimateOptions o) {
    auto tracker = o.tracker.options();
    if (!tracker) return tracker.error();
    std::error_code error;
    if (std::filesystem::exists(o.input + "/rehearsal.json", error)) o.input += "/emulator";
    const bool of_log = std::filesystem::is_directory(o.input, error);
    if (of_log && !o.sets.empty())
        return Error{
            "--set goes with a scene: the frames and sweeps of a run are made again from the scene that it was "
            "flown "
            "with; fly another with `narpa run SCENE --set`",
            o.input};
    if (auto good = none_given(
            of_log ? o.only_of_files : o.only_of_logs,
            of_log ? "goes with a scene file, and this is a folder" : "goes with the folder of a logged run",
            o.input);
        !good)
        return good.error();
    if (!o.batch.on)
        if (auto good = none_given(o.only_of_batches, "goes with --batch"); !good) return good.error();
    if (auto good = check_stereo_flags(o); !good) return good.error();
    o.run.folder = o.input;
    if (of_log && o.batch.on) return estimate_batch(o.run, o.sensors, o.batch, *tracker);
    if (!o.sensors.camera.empty() && !o.sensors.lidar.empty())
        return Error{"--camera and --lidar: expected one of them, or --batch too, for both at once"};
    o.run.sensor = o.sensors.camera + o.sensors.lidar;
    if (!of_log) return estimate_file(std::move(o), *tracker);
    if (o.stereo.on()) return estimate_stereo_run(o.run, o.stereo, *tracker);
    for (const Option& option : o.only_of_frames)
        if (option.given()) o.run.of_frames.push_back(option.name());
    for (const Option& option : o.only_of_sweeps)
        if (option.given()) o.run.of_sweeps.push_back(option.name());
    return estimate_run(o.run, *tracker);
}

}  // namespace

Command add_estimate(Parser app) {
    auto o = std::make_shared<EstimateOptions>();
    const Parser c = app.subcommand("estimate",
                                    "Estimate the target's pose from a logged run, a frame or a sweep, and compare "
                                    "with the truth and the bound");
    c.option("INPUT", o->input,
             "Folder that `run --log` or `rehearse` has written, or a scene with --frame or --sweep")
        .required();
    SceneArgument::add_set_to(c, o->sets);
    add_strict_to(c);
    c.option("--camera", o->sensors.camera, "Name of the camera (default: the first of the scene)")
        .type_name("NAME");
    c.option("--lidar", o->sensors.lidar, "Name of the LiDAR, whose sweeps are estimated").type_name("NAME");
    c.option(
         "--frame", o->file.frames,
         "A frame, also of a real camera: FILE.png, .tif or .pgm in the camera's size and format, or the bytes in "
         "FILE.raw; with --stereo twice, of LEFT and of RIGHT")
        .type_name("FILE")
        .repeatable();
    c.option("--sweep", o->file.sweep, "The LiDAR's data packets, from the earliest on for one turn")
        .type_name("FILE.pcap");
    c.option("--unit", o->file.unit,
             "Source address and destination port of the packets to use, where the capture holds those of several "
             "LiDARs")
        .type_name("ADDRESS:PORT");
    c.option("--time", o->file.time_s, "Simulation time of the frame or the sweep's first shot")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    c.option("--range-noise", o->tracker.tracker.range_noise_m,
             "Standard deviation of the sweep's ranges (default: that of the scene, or 0.02)")
        .type_name("METRES")
        .range(1e-6, 1e3);
    c.flag("--no-truth", o->file.no_truth,
           "The poses are not the truth but a guess: begin there (a sweep: within --start of it), and compare with "
           "nothing");
    o->file.pose.add_to(c);
    c.option("--scene", o->run.scene, "Scene file (default: the run's)").type_name("SCENE");
    o->tracker.add_to(c, "");
    o->batch.add_to(c);
    o->stereo.add_to(c);
    c.option("--every", o->run.every, "Use every N-th frame or sweep").range(1, 1000000);
    c.option("--threads", o->run.threads, "Threads (default: all cores)").range(0, 1024);
    c.option("--csv", o->run.csv, "A row for each frame or sweep").type_name("FILE.csv");
    c.option("-o,--output", o->run.picture, "Errors over time, with three standard deviations and bound")
        .type_name("FILE.png");
    for (const char* name : {"--frame", "--sweep", "--time", "--unit", "--no-truth", "--pose", "--trajectory"})
        o->only_of_files.push_back(c.find(name));
    for (const char* name : {"--method", "--frame-noise"}) o->only_of_frames.push_back(c.find(name));
    for (const char* name : {"--unit", "--range-noise"}) o->only_of_sweeps.push_back(c.find(name));
    for (const char* name : {"--scene", "--every", "--csv", "--output", "--batch"})
        o->only_of_logs.push_back(c.find(name));
    for (const char* name : {"--unknowns", "--path-sigma", "--model-error"})
        o->only_of_batches.push_back(c.find(name));
    for (const char* name : {"--depth-map", "--cloud", "--grid"}) o->only_of_stereo.push_back(c.find(name));
    for (const char* name : {"--camera", "--lidar", "--sweep", "--batch", "--method", "--frame-noise"})
        o->not_of_stereo.push_back(c.find(name));
    c.footer("Exit status 1 if no frame or sweep gave a pose, or that of a single one is ambiguous or refused.");
    c.group("Results");
    c.examples({"narpa estimate out/first-flight -o out/errors.png", "narpa estimate out/first-flight --lidar top",
                "narpa estimate out/first-flight --batch --every 10 -o out/batch.png",
                "narpa estimate docking --frame out/frame.raw",
                "narpa estimate out/pairs --stereo left,right --every 10 --depth-map out/depth.png",
                "narpa estimate asteroid.toml --frame image.png --no-truth --uncertainty scale=0.01,light_deg=1"});
    return [o] { return estimate(*o); };
}

}  // namespace narpa::cli
