// narpa run - the emulator: poses in on CAN, frames and packets out, until the time is over or a signal comes.
#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "apps/cli.h"
#include "apps/device_options.h"
#include "apps/outputs.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "base/ready.h"
#include "base/time.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/pulse/pulse_sink.h"
#include "drivers/pulse/pulse_source.h"
#include "drivers/service_manager.h"
#include "drivers/video/video_sink.h"
#include "emulator/emulator.h"
#include "emulator/realtime.h"
#include "emulator/report.h"
#include "rehearsal/runner/run_folder.h"
#include "tracking/online_estimator.h"

namespace narpa::cli {
namespace {

struct RunCommandOptions {
    SceneArgument scene;
    DeviceOptions devices;
    std::string cpus;
    std::optional<std::uint64_t> seed;
    BudgetOptions budget;
    bool estimates = false;
    std::string estimate_camera;  ///< empty: the first
    TrackerFlags estimator;
    RunOptions run;
    std::optional<double> late_max_percent, patience_s;
    int ready_fd = -1;
};

/// Makes the folders of outputs that are files. `kind_of`: the kind of a sink.
Status make_folders(const DeviceOptions::Outputs& outputs, const auto& kind_of) {
    for (const auto& [sensor, sink] : outputs) {
        const DeviceKind* kind = kind_of(sink);
        if (!kind || kind->destination != Destination::new_file) continue;
        if (auto made = make_folder_of(sink); !made) return made;
    }
    return Ok{};
}

/// Lines for the program that waits on --ready-fd.
std::string addresses(const std::string& bus, CanNode* can) {
    if (!can) return {};
    const CanAddress a = can->bus().address();
    return fmt::format("CAN={}\n{}", a.bus.empty() ? bus : a.bus,
                       a.pty.empty() ? "" : fmt::format("CAN_PTY={}\n", a.pty));
}

Step step_of(const Emulator& emulator) {
    const RunOptions& o = emulator.options();
    const double t_s = static_cast<double>(emulator.t_ns()) * 1e-9;
    if (o.lockstep && t_s == 0) {
        const std::string bodies = emulator.bodies_without_a_pose();
        return {-1, bodies.empty() ? "waiting for commands" : "waiting for the first pose of " + bodies};
    }
    std::string text = fmt::format("t = {:.1f} s", t_s);
    if (o.duration_s > 0) text += fmt::format(" of {:g} s", o.duration_s);
    if (!o.lockstep)
        for (const auto& sensor : emulator.sensors())
            if (const std::string how = sensor->progress(); !how.empty()) text += "; " + how;
    return {o.duration_s > 0 ? t_s / o.duration_s : -1, text};
}

/// Asks the run to stop where its clock stands still for too long.
class Patience {
public:
    Patience(const Emulator& emulator, const std::optional<double>& patience_s) {
        if (!patience_s) return;
        watch_ =
            std::jthread([this, &emulator, most_ns = std::llround(*patience_s * 1e9)](const std::stop_token& stop) {
                std::int64_t t_ns = emulator.t_ns(), moved_ns = monotonic_ns();
                for (; !stop.stop_requested(); std::this_thread::sleep_for(std::chrono::milliseconds(20))) {
                    if (const std::int64_t t = emulator.t_ns(); t != t_ns) t_ns = t, moved_ns = monotonic_ns();
                    if (monotonic_ns() - moved_ns < most_ns) continue;
                    is_over_ = true;
                    stop_flag() = true;
                    return;
                }
            });
    }
    [[nodiscard]] bool is_over() const { return is_over_; }

private:
    std::atomic<bool> is_over_{false};
    std::jthread watch_;
};

/// Tells the service manager's watchdog, twice as often as it asks for, that the run's clock has moved within its
/// time. A run in lockstep may wait for commands, so it counts as moving.
class WatchdogFeed {
public:
    WatchdogFeed(const Emulator& emulator, const ServiceManager& manager) {
        if (!manager.watchdog_ns()) return;
        const std::chrono::nanoseconds pause(*manager.watchdog_ns() / 2);
        beats_ = std::jthread([&emulator, &manager, pause](const std::stop_token& stop) {
            std::mutex mutex;
            std::condition_variable_any stopped;
            std::unique_lock lock(mutex);
            std::int64_t t_ns = emulator.t_ns(), moved_ns = monotonic_ns();
            do {
                if (const std::int64_t now_ns = emulator.t_ns(); now_ns != t_ns || emulator.options().lockstep)
                    t_ns = now_ns, moved_ns = monotonic_ns();
                if (monotonic_ns() - moved_ns < 2 * pause.count()) manager.notify("WATCHDOG=1");
            } while (!stopped.wait_for(lock, stop, pause, [&] { return stop.stop_requested(); }));
        });
    }

private:
    std::jthread beats_;
};

/// Runs to the end and returns the report.
Result<nlohmann::json> run_once(Emulator& emulator, const RunCommandOptions& options,
                                const ServiceManager& manager) {
    const Patience patience(emulator, options.patience_s);
    const Status ran = [&] {
        const WatchdogFeed watchdog(emulator, manager);
        const Progress progress("running", [&] { return step_of(emulator); });
        return emulator.run(stop_flag());
    }();
    if (!ran) return ran.error();
    if (patience.is_over())
        return Error{fmt::format("no command advanced the clock for {:g} s, expected one within --patience",
                                 *options.patience_s),
                     "", 0, 0, ErrorKind::failed};
    return report(emulator);
}

/// "out/run" becomes "out/run-2", "out/run.mcap" "out/run-2.mcap".
RunOptions numbered_outputs(RunOptions o, int number) {
    const std::string suffix = fmt::format("-{}", number);
    if (!o.log_folder.empty()) {
        const std::filesystem::path folder(o.log_folder);
        o.log_folder = (folder.has_filename() ? folder : folder.parent_path()).string() + suffix;
    }
    if (!o.mcap.empty()) {
        const std::filesystem::path file(o.mcap);
        o.mcap = (file.parent_path() / (file.stem().string() + suffix + file.extension().string())).string();
    }
    return o;
}

Outcome run(const RunCommandOptions& options) {
    if (auto good = check_ready_fd(options.ready_fd); !good) return good.error();
    const auto manager = ServiceManager::from_environment();
    if (!manager) return manager.error();
    RunOptions o = options.run;
    if (options.late_max_percent) o.late_max = *options.late_max_percent / 100;
    auto video = options.devices.video(), lidar = options.devices.lidar();
    if (!video) return video.error();
    if (!lidar) return lidar.error();
    o.bus = options.devices.bus;
    o.video = *std::move(video);
    o.lidar = *std::move(lidar);
    if (!options.cpus.empty()) {
        auto cpus = parse_cpus(options.cpus);
        if (!cpus) return cpus.error();
        o.cpus = *std::move(cpus);
    }
    if (options.estimates) {
        auto estimator = options.estimator.options();
        if (!estimator) return estimator.error();
        o.observers.push_back(estimate_from(options.estimate_camera, *estimator));
    }
    o.on_refusal = [](const std::string& what) { say("note: " + what); };
    std::optional<Descriptor> lock;  // two runs into one folder would mix their logs
    if (!o.log_folder.empty()) {
        auto locked = rehearsal::lock_folder(o.log_folder);
        if (!locked) return locked.error();
        lock = *std::move(locked);
    }
    if (!o.lockstep) keep_heap();
    auto scene = options.scene.load();
    if (!scene) return scene.error();
    options.budget.override_scene(scene->render);
    if (options.seed) scene->render.seed = *options.seed;
    if (auto made = make_folders(o.video, video_sink_kind); !made) return made.error();
    if (auto made = make_folders(o.lidar, packet_sink_kind); !made) return made.error();
    if (auto kept = keep_inputs({o.mcap}, *scene, {}); !kept) return kept.error();
    if (auto made = make_folder_of(o.mcap); !made) return made.error();
    auto emulator = Emulator::create(*std::move(scene), o);
    if (!emulator) return emulator.error();

    stop_on_signals();
    if (CanNode* can = (*emulator)->can()) say("commands: " + can->bus().description());
    for (const auto& sensor : (*emulator)->sensors())
        for (const std::string& output : sensor->outputs())
            say(fmt::format("{} {} -> {}", sensor->kind(), sensor->name(), output));
    for (const auto& feed : (*emulator)->observers()) say(feed->observer().description());
    for (const auto& source : (*emulator)->triggers()) say("triggers: " + source->description());
    if (const SecondPulses* pulses = (*emulator)->second_pulses())
        say("pulse per second: " + pulses->description());

    notify_ready(options.ready_fd, addresses(o.bus, (*emulator)->can()));
    manager->notify("READY=1");
    nlohmann::json earlier = nlohmann::json::array();
    for (int number = 1;; ++number) {
        auto document = run_once(**emulator, options, *manager);
        const bool again = (*emulator)->restarted() && !stop_flag();
        if (!again) manager->notify("STOPPING=1");
        say(to_text(**emulator));
        if (!document) return document.error();
        if (!options.estimates) (*document)["estimate"] = nullptr;
        if (!again) {
            if ((*emulator)->world().scene().time.on_restart == TimeSettings::OnRestart::new_run) {
                for (const auto& run : earlier)
                    if (!run["passed"].get<bool>()) (*document)["passed"] = false;
                (*document)["earlier_runs"] = earlier;
            }
            return *std::move(document);
        }
        earlier.push_back(*std::move(document));
        const RunOptions next = numbered_outputs(o, number + 1);
        say(fmt::format("the dynamics began again: run {}{}", number + 1,
                        next.log_folder.empty() ? "" : ", log " + next.log_folder));
        if (!next.log_folder.empty()) {
            auto locked = rehearsal::lock_folder(next.log_folder);
            if (!locked) return locked.error();
            lock = *std::move(locked);
        }
        emulator = Emulator::create_next(*std::move(emulator), next);
        if (!emulator) return emulator.error();
    }
}

}  // namespace

Command add_run(Parser app) {
    auto o = std::make_shared<RunCommandOptions>();
    const Parser c =
        app.subcommand("run", "Run the emulator: poses in on CAN, camera frames and LiDAR packets out");
    o->scene.add_to(c);
    o->devices.add_to(c);
    const Option lockstep = c.flag("--lockstep", o->run.lockstep,
                                   "The clock advances only with commands; no wall time enters any result");
    c.option(
         "--patience", o->patience_s,
         "Wall seconds without progress after which a lockstep run ends with status 1 (default: waits for ever)")
        .type_name("SECONDS")
        .range(0.001, 1e6)
        .needs(lockstep);
    c.option("--trigger", o->run.triggers,
             pulse_source_help() + "; exposes the cameras in trigger mode external; may be given many times")
        .type_name("SOURCE")
        .repeatable()
        .excludes(lockstep);
    c.option("--pps", o->run.second_pulses, "One pulse per second of UTC: " + pulse_sink_help())
        .type_name("LINE")
        .excludes(lockstep);
    c.option("--seed", o->seed, "Seed of the sensors' noise and of the renders, instead of the scene's");
    c.option("--duration", o->run.duration_s, "Seconds of simulation time (default: until stopped)")
        .type_name("SECONDS")
        .above_zero(9e9);
    const Option log =
        c.option("--log", o->run.log_folder,
                 "Folder for run.json, truth, ledger, CAN log and contact sheet; replaces an earlier run in it")
            .type_name("DIR");
    add_mcap_to(c, o->run.mcap);
    c.flag("--log-shots", o->run.log_shots,
           "Log every LiDAR shot too: time, exact range, body, incidence, velocity, and the reported values (about "
           "40 MB a second for 300,000 shots a second)")
        .needs(log);
    const Option estimate =
        c.option(
             "--estimate", o->estimate_camera,
             "Estimate the target's pose from this camera's frames (default: the first), on a thread of its own")
            .values(0, 1)
            .type_name("[CAMERA]");
    o->estimator.add_to(c, "estimate-");
    for (const char* name : {"--estimate-target", "--estimate-method", "--estimate-start", "--estimate-range-guess",
                             "--estimate-seed", "--estimate-uncertainty", "--estimate-frame-noise"})
        c.find(name).needs(estimate);
    o->budget.add_to(c);
    c.option("--late-max", o->late_max_percent,
             "Fail if more than this percentage of a camera's frames were late or skipped")
        .range(0.0, 100.0)
        .excludes(lockstep);
    c.option("--cpus", o->cpus, "Processors for the threads that trace rays, as 0,1 or 2-3; each is bound to one")
        .type_name("LIST")
        .excludes(lockstep);
    c.option("--threads", o->run.threads, "Threads that trace rays (default: all cores)").range(0, 1024);
    c.option("--ready-fd", o->ready_fd,
             "Descriptor that gets the lines CAN=BUS and READY=1 once the emulator can be reached");
    c.group("Sensors");
    c.examples(
        {"narpa run docking --can vcan0 --video nav=/dev/video10 --lidar top=udp:192.168.1.70:2368 --log out/run",
         "narpa run docking --can slcan:29537 --video nav=out/frames.y4m --lockstep",
         "narpa run docking --video nav=none --duration 10"});
    return [o, estimate] {
        o->estimates = estimate.given();
        return run(*o);
    };
}

}  // namespace narpa::cli
