// narpa estimate - the pose of the target from the frames of a logged run, or from one frame or sweep in a file,
// with covariance, bound and truth.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <random>

#include "apps/cli.h"
#include "apps/commands/estimate_batch.h"
#include "apps/commands/estimate_run.h"
#include "apps/commands/sweep_file.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "apps/warnings.h"
#include "emulator/threads.h"
#include "estimator/cloud/cloud_icp.h"
#include "estimator/cloud/own_body.h"
#include "estimator/search/cloud_search.h"
#include "estimator/uncertainty/observed_error.h"
#include "estimator/view/measured_image.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/scene_file.h"
#include "tracking/estimate_report.h"

namespace narpa::cli {
namespace {

struct EstimateOptions {
    std::string input;
    std::vector<std::string> sets;  ///< of the scene
    TrackerFlags tracker;
    RunEstimate run;  ///< of a logged run; its sensor and threads hold for a file too
    BatchSensors sensors;
    BatchFlags batch;

    // Of a single file. Scene, trajectory and --pose give the truth, or with `no_truth` the initial guess. Without
    // `no_truth`, the guess is the truth displaced.
    std::string frame, sweep;  ///< an image or FILE.raw; FILE.pcap
    double time_s = 0;
    std::string unit;       ///< of the sweep's capture; empty: it holds packets of one
    bool no_truth = false;  ///< the poses are a guess
    PoseOptions pose;

    std::vector<Option> only_of_files, only_of_logs, only_of_frames, only_of_sweeps, only_of_batches;
};

// --- One frame or one sweep in a file ---------------------------------------------------------------------------

Result<std::unique_ptr<World>> world_of(const EstimateOptions& o, std::int64_t t_ns, std::int64_t until_ns) {
    auto scene = SceneArgument{o.input, o.sets}.load();
    if (!scene) return scene.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = o.sweep.empty() ? World::create(*std::move(scene)) : World::create_for_lidars(*std::move(scene));
    if (!world) return world;
    if (auto loaded = o.pose.load(**world, t_ns, until_ns); !loaded) return loaded.error();
    return world;
}

/// Target and sensor of an estimate, and the pose that it is compared with.
struct Estimated {
    std::string target, sensor, sensor_kind;  ///< the last: "camera" or "lidar"
    Rigid3 T_world_sensor{}, known{};         ///< `known`: T_sensor_target, the truth or the guess
    bool known_is_guess = false;
};

/// Prints an estimate beside the truth or the guess. Returns the document; `passed` if the pose is usable.
nlohmann::json show(const Estimated& of, const Rigid3& T, const Matrix6& covariance, const Matrix6& bound,
                    const Answer& answer) {
    const Vector6 error = error_between(T, of.known);
    const ObservedError nees = observed_error(T, covariance, answer, of.known);
    const NeesBand band = nees_band(nees.freedom);
    const Rigid3 in_world = of.T_world_sensor * T;
    say(fmt::format("{} in {} {}: position ({:.6g}, {:.6g}, {:.6g}) m, attitude ({:.7f}, {:.7f}, {:.7f}, {:.7f})",
                    of.target, of.sensor_kind, of.sensor, T.t.x, T.t.y, T.t.z, T.q.w, T.q.x, T.q.y, T.q.z));
    const std::string off =
        fmt::format("{:.3g} deg and {:.3g} m", error.head<3>().norm() / kDegree, error.tail<3>().norm());
    if (of.known_is_guess)
        say(fmt::format(
            "  off the guess by {}; in the world: --pose {}={:.9g},{:.9g},{:.9g},{:.9f},{:.9f},{:.9f},{:.9f}", off,
            of.target, in_world.t.x, in_world.t.y, in_world.t.z, in_world.q.w, in_world.q.x, in_world.q.y,
            in_world.q.z));
    else
        say(fmt::format("  off the truth by {}; NEES {:.2f}, {} expected, 95 % band {:g} to {:g}; {}", off,
                        nees.squared, nees.freedom, band.low, band.high,
                        nees_verdict(nees.squared, band.low, band.high)));
    say(fmt::format("  standard deviations {:.3g} deg, {:.3g} m; bound {:.3g} deg, {:.3g} m",
                    rotation_sigma(covariance) / kDegree, position_sigma(covariance),
                    rotation_sigma(bound) / kDegree, position_sigma(bound)));
    say(fmt::format("  {}{}{}", kAnswerKinds[static_cast<std::size_t>(answer.kind)], answer.why.empty() ? "" : ": ",
                    answer.why));
    std::array<std::array<double, 6>, 6> rows{};
    for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) rows[std::size_t(i)][std::size_t(j)] = covariance(i, j);
    nlohmann::json document{{"passed", answer.usable()},
                            {"target", of.target},
                            {of.sensor_kind, of.sensor},
                            {"answer", to_json(answer)},
                            {"pose", to_json(T)},
                            {"pose_in_world", to_json(in_world)},
                            {"covariance", rows},
                            {"bound_rotation_rad", rotation_sigma(bound)},
                            {"bound_position_m", position_sigma(bound)},
                            {of.known_is_guess ? "guess" : "truth", to_json(of.known)}};
    if (of.known_is_guess) return document;
    document["error_rotation_rad"] = error.head<3>().norm(), document["error_position_m"] = error.tail<3>().norm();
    document["nees"] = std::isfinite(nees.squared) ? nlohmann::json(nees.squared) : nlohmann::json(nullptr);
    document["nees_expected"] = nees.freedom;
    return document;
}

nlohmann::json no_pose(const std::string& file, const Answer& answer, const std::string& why) {
    say(fmt::format("{} gives no pose: {}: {}", file, kAnswerKinds[static_cast<std::size_t>(answer.kind)], why));
    return {{"passed", false}, {"answer", to_json(answer)}};
}

/// Ledger of a frame with the exposure of the scene.
FrameLedger nominal_ledger(const Camera& camera, std::int64_t t_ns) {
    FrameLedger taken;
    taken.t_exposure_mid_ns = t_ns;
    taken.t_exposure_start_ns = t_ns - exposure_ns(camera) / 2;
    taken.t_exposure_end_ns = taken.t_exposure_start_ns + exposure_ns(camera);
    taken.region_width = static_cast<std::uint16_t>(camera.width);
    taken.region_height = static_cast<std::uint16_t>(camera.height);
    return taken;
}

Outcome estimate_frame(const EstimateOptions& o, TrackerOptions options) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    auto world = world_of(o, t_ns, t_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto camera = sensor_named(scene.cameras, o.run.sensor, "camera", scene.file);
    if (!camera) return camera.error();
    const auto target =
        target_of(**world, scene.cameras[*camera].mount, scene.cameras[*camera].name, options.target);
    if (!target) return target.error();
    auto bytes = load_frame(o.frame, scene.cameras[*camera]);
    if (!bytes) return bytes.error();
    if (auto image = measured_image(scene.cameras[*camera], *bytes); !image)
        return Error{image.error().what, o.frame};
    BodyPoses at(scene.bodies.size());
    (*world)->place(t_ns, scene.cameras[*camera].mount, at);
    const Rigid3 T_world_camera = (*world)->camera_pose(scene.cameras[*camera], o.time_s, at);
    if (o.no_truth) options.guess = inverse(T_world_camera) * at.T_world_body[*target];
    TracingThreads threads(o.run.threads);
    TrackedFrame tracked;
    {
        const Progress progress("estimating the pose in " + o.frame);
        const auto take = [&] {
            const auto tracker = FrameTracker::create(**world, *camera, options);
            const int renders = tracked.renders;
            tracked = (*tracker)->take(nominal_ledger(scene.cameras[*camera], t_ns), *bytes, at);
            tracked.renders += renders;
        };
        threads.arena.execute([&] {
            take();
            if (!options.guess || !tracked.measured || options.search ||
                !options.method->light_is_that_of_the_guess)
                return;
            // Repeats with the illumination at the estimated attitude.
            at.set(*target, T_world_camera * *tracked.measured);
            take();
        });
    }
    if (!tracked.measured) return no_pose(o.frame, tracked.answer, tracked.why);
    nlohmann::json document = show({scene.bodies[*target].name, scene.cameras[*camera].name, "camera",
                                    T_world_camera, options.guess.value_or(tracked.truth), o.no_truth},
                                   *tracked.measured, tracked.covariance, tracked.bound, tracked.answer);
    document["matches"] = tracked.matches;
    document["renders"] = tracked.renders;
    return document;
}

Outcome estimate_sweep(const EstimateOptions& o, const TrackerOptions& tracker) {
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    constexpr std::int64_t kLater_ns = 10'000'000;
    auto world = world_of(o, t_ns, t_ns + kLater_ns);
    if (!world) return world.error();
    const Scene& scene = (*world)->scene();
    const auto index = sensor_named(scene.lidars, o.run.sensor, "LiDAR", scene.file);
    if (!index) return index.error();
    const Lidar& lidar = scene.lidars[*index];
    auto target = target_of(**world, lidar.mount, lidar.name, tracker.target);
    if (!target) return target.error();
    auto captured = read_sweep(o.sweep, *lidar.model, o.unit);
    if (!captured) return captured.error();
    for (const std::string& warning : captured->warnings) warn(warning);
    LidarSweep& sweep = captured->sweep;
    BodyPoses then(scene.bodies.size());
    (*world)->place(t_ns, lidar.mount, then);
    remove_own_body((*world)->tracer(), lidar, sweep);
    const auto T_lidar_target_at = [&](std::int64_t t) {
        BodyPoses at(scene.bodies.size());
        (*world)->place(t, lidar.mount, at);
        return inverse((*world)->sensor_pose(lidar.mount, lidar.T_mount_lidar, at)) * at.T_world_body[*target];
    };
    const Rigid3 truth = T_lidar_target_at(t_ns);  // or the guess
    const Rigid3 T_world_lidar = (*world)->sensor_pose(lidar.mount, lidar.T_mount_lidar, then);
    const ApparentMotion motion = motion_between(truth, T_lidar_target_at(t_ns + kLater_ns), kLater_ns * 1e-9);
    std::mt19937_64 random(tracker.seed);
    const Rigid3 guess = o.no_truth ? truth : displaced_truth(truth, tracker, random);
    const double search_m = 0.01 * tracker.start_percent * norm(truth.t) +
                            tracker.start_deg * kDegree * (*world)->tracer().bounding_radius_m(*target);
    IcpSettings settings;
    settings.model = tracker.model;
    settings.noise = range_noise_of(lidar);
    settings.certain = certain_return_of(lidar, scene);
    if (tracker.range_noise_m > 0) settings.noise.range_m = tracker.range_noise_m;
    TracingThreads threads(o.run.threads);
    std::optional<Result<CloudEstimate>> found;
    {
        const Progress progress("estimating the pose in " + o.sweep);
        const auto estimate = [&] {
            const Tracer& tracer = (*world)->tracer();
            return tracker.search ? CloudSearch(tracer, *target, settings).find(sweep.points, motion, sweep.empty)
                                  : CloudIcp(tracer, *target, settings)
                                        .align(sweep.points, motion, guess, search_m, sweep.empty,
                                               start_covariance(tracker, norm(truth.t)));
        };
        threads.arena.execute([&] { found.emplace(estimate()); });
    }
    if (!*found) return Error{found->error().what, o.sweep, 0, 0, ErrorKind::failed};
    const CloudEstimate& e = **found;
    if (e.used < kFewestSweepPoints) return no_pose(o.sweep, e.answer, e.answer.why);
    nlohmann::json document =
        show({scene.bodies[*target].name, lidar.name, "lidar", T_world_lidar, truth, o.no_truth}, e.T_lidar_target,
             e.covariance, e.bound, e.answer);
    const int unobserved = e.observability.unobserved;
    say(
        fmt::format("  {} returns (its own body's left out), {} used, {} as the model has them; {} motions that "
                    "cannot be seen; {} iterations",
                    e.points, e.used, e.explained, unobserved, e.iterations));
    document["capture"] = to_json(*captured);
    document["empty"] = e.empty_beams.empty;
    document["points"] = e.points;
    document["used"] = e.used;
    document["explained"] = e.explained;
    document["unobserved"] = unobserved;
    document["iterations"] = e.iterations;
    return document;
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
    for (const Option& option : of_log ? o.only_of_files : o.only_of_logs)
        if (option.given())
            return Error{fmt::format("{} goes with {}", option.name(),
                                     of_log ? "a scene file, and this is a folder" : "the folder of a logged run"),
                         o.input};
    for (const Option& option : o.only_of_batches)
        if (option.given() && !o.batch.on) return Error{fmt::format("{} goes with --batch", option.name())};
    if (of_log && o.batch.on) {
        o.run.folder = o.input;
        return estimate_batch(o.run, o.sensors, o.batch, *tracker);
    }
    if (!o.sensors.camera.empty() && !o.sensors.lidar.empty())
        return Error{"--camera and --lidar: expected one of them, or --batch too, for both at once"};
    o.run.sensor = o.sensors.camera + o.sensors.lidar;
    if (of_log) {
        for (const Option& option : o.only_of_frames)
            if (option.given()) o.run.of_frames.push_back(option.name());
        for (const Option& option : o.only_of_sweeps)
            if (option.given()) o.run.of_sweeps.push_back(option.name());
        o.run.folder = o.input;
        return estimate_run(o.run, *tracker);
    }
    if (tracker->range_guess_m > 0 && !o.sweep.empty())
        return Error{"a range is guessed for frames, not for a sweep, which measures it"};
    if (o.frame.empty() && o.sweep.empty() && !find_file(FileKind::scene, o.input))
        return Error{
            "no such folder, expected that of a logged run or rehearsal, or a scene with --frame FILE or "
            "--sweep FILE.pcap",
            o.input};
    if (o.frame.empty() == o.sweep.empty())
        return Error{"with a scene, expected one of --frame FILE and --sweep FILE.pcap", o.input};
    for (const Option& option : o.frame.empty() ? o.only_of_frames : o.only_of_sweeps)
        if (option.given())
            return Error{fmt::format("{} goes with a {}, and this is a {}", option.name(),
                                     o.frame.empty() ? "frame" : "sweep", o.frame.empty() ? "sweep" : "frame"),
                         o.frame.empty() ? o.sweep : o.frame};
    return o.frame.empty() ? estimate_sweep(o, *tracker) : estimate_frame(o, *tracker);
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
         "--frame", o->frame,
         "A frame, also of a real camera: FILE.png, .tif or .pgm in the camera's size and format, or the bytes in "
         "FILE.raw")
        .type_name("FILE");
    c.option("--sweep", o->sweep, "The LiDAR's data packets, from the earliest on for one turn")
        .type_name("FILE.pcap");
    c.option("--unit", o->unit,
             "Source address and destination port of the packets to use, where the capture holds those of several "
             "LiDARs")
        .type_name("ADDRESS:PORT");
    c.option("--time", o->time_s, "Simulation time of the frame or the sweep's first shot")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    c.option("--range-noise", o->tracker.tracker.range_noise_m,
             "Standard deviation of the sweep's ranges (default: that of the scene, or 0.02)")
        .type_name("METRES")
        .range(1e-6, 1e3);
    c.flag("--no-truth", o->no_truth,
           "The poses are not the truth but a guess: begin there (a sweep: within --start of it), and compare with "
           "nothing");
    o->pose.add_to(c);
    c.option("--scene", o->run.scene, "Scene file (default: the run's)").type_name("SCENE");
    o->tracker.add_to(c, "");
    o->batch.add_to(c);
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
    c.footer("Exit status 1 if no frame or sweep gave a pose, or that of a single one is ambiguous or refused.");
    c.group("Results");
    c.examples({"narpa estimate out/first-flight -o out/errors.png", "narpa estimate out/first-flight --lidar top",
                "narpa estimate out/first-flight --batch --every 10 -o out/batch.png",
                "narpa estimate docking --frame out/frame.raw",
                "narpa estimate asteroid.toml --frame image.png --no-truth --uncertainty scale=0.01,light_deg=1"});
    return [o] { return estimate(*o); };
}

}  // namespace narpa::cli
