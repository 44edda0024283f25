#include "apps/commands/estimate_batch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "apps/commands/remade.h"
#include "base/write_file.h"
#include "emulator/log/run_record.h"
#include "tracking/batch_feed.h"
#include "tracking/batch_model.h"
#include "tracking/batch_report.h"

namespace narpa::cli {
namespace {

/// What was asked for, checked.
struct BatchPlan {
    const RunEstimate& run;
    TrackerOptions tracker;
    BatchOptions options;
    BatchValues error{};        ///< of the model
    std::string camera, lidar;  ///< empty: not used

    /// Albedo or the light's direction are unknown.
    [[nodiscard]] bool observes_brightness() const {
        return std::ranges::any_of(kBrightnessUnknowns,
                                   [&](BatchUnknown u) { return at(options.prior_sigma, u) > 0; });
    }
    [[nodiscard]] std::int64_t stamp_late_ns() const { return std::llround(1e9 * at(error, BatchUnknown::clock)); }
};

Result<std::optional<PathSigma>> path_sigma_of(const std::string& text) {
    if (text.empty()) return std::optional<PathSigma>{};
    double deg = 0, metres = 0;
    int used = 0;
    const bool read =
        std::sscanf(text.c_str(), "%lf,%lf%n", &deg, &metres, &used) == 2 && used == static_cast<int>(text.size());
    if (!read || !(deg > 0 && deg <= 180) || !(metres > 0 && metres <= 1e6))
        return Error{fmt::format("--path-sigma \"{}\", expected DEG,METRES above 0, like 0.01,0.001", text)};
    return std::optional(PathSigma{deg * kDegree, metres});
}

/// Chooses the sensors. Errors: names that no sensor has, sensors on different bodies.
Status choose_sensors(const BatchSensors& wanted, BatchPlan& plan) {
    const auto record = read_run_record(plan.run.folder);
    if (!record) return record.error();
    const auto scene = read_run_scene(*record, plan.run.scene);
    if (!scene) return scene.error();
    const bool all = wanted.camera.empty() && wanted.lidar.empty();
    const Camera* camera = nullptr;
    if (!wanted.camera.empty() || (all && !scene->cameras.empty())) {
        const auto index = sensor_named(scene->cameras, wanted.camera, "camera", scene->file);
        if (!index) return index.error();
        camera = &scene->cameras[*index];
        plan.camera = camera->name;
    }
    if (wanted.lidar.empty() && (!all || scene->lidars.empty())) return Ok{};
    const auto index = sensor_named(scene->lidars, wanted.lidar, "LiDAR", scene->file);
    if (!index) return index.error();
    const Lidar& lidar = scene->lidars[*index];
    if (camera && (camera->mount < 0 || camera->mount != lidar.mount)) {
        if (all) return Ok{};
        return Error{
            fmt::format("camera \"{}\" and LiDAR \"{}\" are not on one body, expected sensors of one chaser",
                        camera->name, lidar.name),
            scene->file};
    }
    plan.lidar = lidar.name;
    return Ok{};
}

/// Of sweeps one after another: ICP of points on a target of another size needs to know that its size is uncertain.
TrackerOptions sweep_tracker(const BatchPlan& plan) {
    TrackerOptions options = plan.tracker;
    options.model.scale = std::max(options.model.scale, at(plan.options.prior_sigma, BatchUnknown::scale));
    return options;
}

Result<BatchPlan> plan_of(const RunEstimate& run, const BatchSensors& sensors, const BatchFlags& flags,
                          const TrackerOptions& tracker) {
    BatchPlan plan{.run = run, .tracker = tracker, .options = {}, .error = {}, .camera = {}, .lidar = {}};
    if (tracker.search)
        return Error{"--batch follows the target from frame to frame: expected --start DEG,PERCENT, not search"};
    if (!tracker.method->finds_points)
        return Error{
            fmt::format("--batch goes with methods that find points, not with \"{}\": expected --method {}",
                        tracker.method->name, camera_methods_that_find_points())};
    if (!flags.unknowns.empty()) {
        const BatchValues all = all_batch_priors();
        const auto sigma = flags.unknowns == "none" ? Result<BatchValues>(BatchValues{})
                                                    : batch_values(flags.unknowns, "--unknowns", &all, false);
        if (!sigma) return sigma.error();
        plan.options.prior_sigma = *sigma;
    }
    const auto error = batch_values(flags.model_error, "--model-error", nullptr, true);
    if (!error) return error.error();
    plan.error = *error;
    const auto path = path_sigma_of(flags.path_sigma);
    if (!path) return path.error();
    plan.options.path = *path;
    plan.options.motion.acceleration_psd = tracker.acceleration_psd;
    plan.options.motion.angular_acceleration_psd = tracker.angular_acceleration_psd;
    plan.tracker.guesses_from_truth = true;
    plan.options.frame_variance = tracker.method->variance_between_frames;
    if (auto chosen = choose_sensors(sensors, plan); !chosen) return chosen.error();
    return plan;
}

/// The world as the batch takes it to be: that of the run, or a copy with errors in `made`.
Result<const World*> model_of(const BatchPlan& plan, const World& truth, int mount, const std::string& sensor,
                              bool for_lidars, std::unique_ptr<World>& made) {
    BatchValues of_scene = plan.error;
    at(of_scene, BatchUnknown::clock) = at(of_scene, BatchUnknown::range_bias) = 0;
    if (of_scene == BatchValues{}) return &truth;
    const auto target = target_of(truth, mount, sensor, plan.tracker.target);
    if (!target) return target.error();
    Scene scene = truth.scene();
    if (auto good = apply_model_errors(of_scene, *target, scene); !good) return good.error();
    auto world = for_lidars ? World::create_for_lidars(std::move(scene)) : World::create(std::move(scene));
    if (!world) return world.error();
    made = *std::move(world);
    return made.get();
}

/// A sensor of the run: its feed, and the worlds that it refers to.
struct FrameSource {
    std::unique_ptr<Replay> run;
    std::unique_ptr<World> model;
    std::unique_ptr<BatchFrameFeed> feed;
};
struct SweepSource {
    std::unique_ptr<SweepReplay> run;
    std::unique_ptr<World> model;
    std::unique_ptr<BatchSweepFeed> feed;
};

/// Renders the frames again, bit for bit, and tracks the target through them.
Status track_frames(const BatchPlan& plan, FrameSource& source) {
    auto opened = Replay::open(plan.run.folder, plan.camera, plan.run.scene);
    if (!opened) return opened.error();
    source.run = *std::move(opened);
    Replay& run = *source.run;
    const Camera& camera = run.camera();
    const auto model = model_of(plan, run.world(), camera.mount, camera.name, false, source.model);
    if (!model) return model.error();
    auto feed = BatchFrameFeed::create(**model, run.camera_index(), plan.tracker, plan.observes_brightness());
    if (!feed) return feed.error();
    source.feed = *std::move(feed);
    const std::int64_t late_ns = plan.lidar.empty() ? plan.stamp_late_ns() : 0;
    return each_frame(
        plan.run, run,
        [&](std::size_t i) {
            source.feed->take(run.frames()[i].ledger, run.bytes(), run.world(), run.placement(i), late_ns);
            return Ok{};
        },
        [&](std::size_t i) { source.feed->pass(run.frames()[i].ledger, run.world(), run.placement(i)); });
}

/// Makes the sweeps again and tracks the target through them.
Status track_sweeps(const BatchPlan& plan, SweepSource& source) {
    auto opened = SweepReplay::open(plan.run.folder, plan.lidar, plan.run.scene);
    if (!opened) return opened.error();
    source.run = *std::move(opened);
    SweepReplay& run = *source.run;
    const auto model = model_of(plan, run.world(), run.lidar().mount, run.lidar().name, true, source.model);
    if (!model) return model.error();
    auto feed = BatchSweepFeed::create(run.world(), **model, run.lidar_index(), sweep_tracker(plan));
    if (!feed) return feed.error();
    source.feed = *std::move(feed);
    return each_sweep(plan.run, run, [&](const ReplayedSweep& made) {
        source.feed->take(made, plan.stamp_late_ns(), at(plan.error, BatchUnknown::range_bias));
    });
}

/// Solves for what the frames' points tell, then compares brightness with the model corrected by it: twice, as
/// brightness is not linear in the light's direction.
Status observe_brightness(const BatchOptions& all, const BatchFrameFeed& frames, BatchInput& input) {
    BatchOptions options = all;
    for (const BatchUnknown u : kBrightnessUnknowns) at(options.prior_sigma, u) = 0;
    for (int k = 0; k < 2; ++k, options = all) {
        const auto found = solve_batch(input, options);
        if (!found) return found.error();
        frames.observe_brightness(*found, input);
    }
    return Ok{};
}

BatchTruth truth_of(const BatchInput& input, const BatchValues& error) {
    BatchTruth truth;
    truth.unknowns = expected_of(error);
    for (const BatchFrame& f : input.frames) truth.times.push_back(f.time);
    for (const BatchSweep& s : input.sweeps) truth.times.push_back(s.time);
    std::ranges::sort(truth.times, {}, &BatchTime::t_ns);
    return truth;
}

Outcome report(const BatchPlan& plan, const BatchResult& result, const BatchTruth& truth) {
    say(fmt::format("{}: {}", plan.run.folder, to_text(result, truth)));
    if (!plan.run.csv.empty())
        if (auto written = write_file(plan.run.csv, batch_rows(result, truth)); !written) return written.error();
    if (!plan.run.picture.empty())
        if (auto written = plot_batch(plan.run.picture, plan.run.folder, result, truth); !written)
            return written.error();
    for (const std::string& file : {plan.run.csv, plan.run.picture})
        if (!file.empty()) say("wrote " + file);
    nlohmann::json document{
        {"passed", result.settled}, {"log", plan.run.folder}, {"batch", to_json(result, truth)}};
    if (!plan.camera.empty()) document["camera"] = plan.camera, document["method"] = plan.tracker.method->name;
    if (!plan.lidar.empty()) document["lidar"] = plan.lidar;
    return document;
}

}  // namespace

Outcome estimate_batch(const RunEstimate& run, const BatchSensors& sensors, const BatchFlags& flags,
                       const TrackerOptions& tracker) {
    if (auto made = make_folder_of(run.csv); !made) return made.error();
    if (auto made = make_folder_of_picture(run.picture); !made) return made.error();
    const auto plan = plan_of(run, sensors, flags, tracker);
    if (!plan) return plan.error();
    FrameSource frames;
    SweepSource sweeps;
    if (!plan->camera.empty())
        if (auto tracked = track_frames(*plan, frames); !tracked) return tracked.error();
    if (!plan->lidar.empty())
        if (auto tracked = track_sweeps(*plan, sweeps); !tracked) return tracked.error();
    BatchInput input;
    if (frames.feed) frames.feed->finish(input);
    if (sweeps.feed) sweeps.feed->finish(input);
    if (frames.feed && plan->observes_brightness())
        if (auto observed = observe_brightness(plan->options, *frames.feed, input); !observed)
            return Error{observed.error().what, run.folder, 0, 0, observed.error().kind};
    BatchTruth truth = truth_of(input, plan->error);
    if (frames.feed) truth.alone.push_back(summarise(frames.feed->tracked()));
    if (sweeps.feed) truth.alone.push_back(summarise(sweeps.feed->tracked()));
    const auto result = solve_batch(input, plan->options);
    if (!result) return Error{result.error().what, run.folder, 0, 0, result.error().kind};
    return report(*plan, *result, truth);
}

}  // namespace narpa::cli
