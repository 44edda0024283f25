#include "emulator/emulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "emulator/log/run_record.h"
#include "emulator/threads.h"

namespace narpa {
namespace {

/// The sinks of one sensor, opened in the order in which they were given.
template <class Sink, class Open>
Result<std::vector<std::unique_ptr<Sink>>> open_sinks(
    const std::vector<std::pair<std::string, std::string>>& wanted, std::size_t sensor, const auto& sensors,
    std::string_view kind, const std::string& file, Open open) {
    std::vector<std::unique_ptr<Sink>> sinks;
    for (const auto& [name, spec] : wanted) {
        auto index = sensor_named(sensors, name, kind, file);
        if (!index) return index.error();
        if (*index != sensor) continue;
        auto sink = open(spec);
        if (!sink) return sink.error();
        sinks.push_back(*std::move(sink));
    }
    return sinks;
}

/// A time budget is for real time, and ends before the next frame of the same camera is due; the scene's own was
/// looked at when the scene was read.
Status check_budget(const Scene& scene, const RunOptions& options) {
    const std::int64_t budget_ns = scene.render.budget_ns;
    if (budget_ns <= 0) return Ok{};
    if (options.lockstep)
        return Error{
            "a budget in milliseconds cannot be kept in lockstep, where no wall time enters any result; "
            "expected --budget-rays or --spp (budget_rays or spp in [render])",
            scene.file};
    for (const Camera& c : scene.cameras) {
        const bool wanted = std::ranges::any_of(options.video, [&](const auto& v) { return v.first == c.name; });
        if (wanted && budget_ns > c.period_ns)
            return Error{fmt::format("--budget-ms {}, expected at most the period of camera \"{}\", {} ms",
                                     static_cast<double>(budget_ns) * 1e-6, c.name,
                                     static_cast<double>(c.period_ns) * 1e-6)};
    }
    return Ok{};
}

}  // namespace

Emulator::Emulator() = default;
Emulator::~Emulator() = default;

Result<std::unique_ptr<Emulator>> Emulator::create(Scene scene, const RunOptions& options) {
    if (options.video.empty() && options.lidar.empty())
        return Error{"nothing to put out, expected at least one --video CAMERA=SINK or --lidar LIDAR=SINK"};
    if (options.lockstep && options.bus.empty())
        return Error{"--lockstep needs --can BUS: the clock advances only with commands"};
    if (auto good = check_budget(scene, options); !good) return good.error();
    auto world = World::create(std::move(scene));
    if (!world) return world.error();
    if (options.lockstep && !(*world)->has_commanded_bodies())
        return Error{"--lockstep needs a body with a can_id", (*world)->scene().file};

    std::unique_ptr<Emulator> emulator(new Emulator);
    emulator->options_ = options;
    emulator->world_ = *std::move(world);
    emulator->end_ns_ =
        options.duration_s > 0 ? std::llround(options.duration_s * 1e9) : std::numeric_limits<std::int64_t>::max();
    emulator->threads_ = std::make_unique<TracingThreads>(options.threads, options.cpus);
    if (auto opened = emulator->open_outputs(); !opened) return opened.error();
    if (options.estimate)
        if (auto opened = emulator->open_estimator(); !opened) return opened.error();
    return emulator;
}

Status Emulator::open_outputs() {
    const Scene& scene = world_->scene();
    const bool wait = options_.lockstep;
    if (!options_.log_folder.empty()) {
        std::error_code error;
        std::filesystem::create_directories(options_.log_folder, error);
        if (error) return Error{"cannot be made a folder: " + error.message(), options_.log_folder};
        if (auto recorded = write_run_record(options_.log_folder, scene); !recorded) return recorded.error();
    }
    if (!options_.bus.empty()) {
        auto bus = open_can_bus(options_.bus, CanRole::hub);
        if (!bus) return bus.error();
        bus_ = *std::move(bus);
        if (!options_.log_folder.empty()) {
            auto log = RowLog::create(options_.log_folder + "/can.log", "", wait);
            if (!log) return log.error();
            can_log_ = *std::move(log);
        }
        can_ = std::make_unique<CanNode>(*world_, *bus_, can_log_.get(), !options_.lockstep);
    }
    for (std::size_t i = 0; i < scene.cameras.size(); ++i) {
        const Camera& c = scene.cameras[i];
        const VideoFormat format{c.width, c.height, c.format, c.period_ns};
        auto sinks =
            open_sinks<VideoSink>(options_.video, i, scene.cameras, "camera", scene.file, [&](const auto& spec) {
                return open_video_sink(spec, format, wait ? WhenFull::wait : WhenFull::drop);
            });
        if (!sinks) return sinks.error();
        if (sinks->empty()) continue;  // a camera that nobody asked for costs nothing
        cameras_.push_back(std::make_unique<CameraFeed>(*world_, i, *std::move(sinks)));
        if (can_) cameras_.back()->keep_ledgers();
        if (!options_.log_folder.empty())
            if (auto logs = cameras_.back()->log_to(options_.log_folder, wait); !logs) return logs.error();
    }
    for (std::size_t i = 0; i < scene.lidars.size(); ++i) {
        auto sinks =
            open_sinks<PacketSink>(options_.lidar, i, scene.lidars, "LiDAR", scene.file, [&](const auto& spec) {
                return open_packet_sink(spec, scene.lidars[i].model->spec().network, scene.epoch_unix_ns, wait);
            });
        if (!sinks) return sinks.error();
        if (!sinks->empty()) lidars_.push_back(std::make_unique<LidarFeed>(*world_, i, *std::move(sinks)));
    }
    // A name that fits no sensor is caught above only where there are sensors of its kind.
    if (!options_.video.empty() && cameras_.empty()) return Error{"the scene has no camera", scene.file};
    if (!options_.lidar.empty() && lidars_.empty()) return Error{"the scene has no LiDAR", scene.file};
    return Ok{};
}

Status Emulator::open_estimator() {
    const Scene& scene = world_->scene();
    if (cameras_.empty())
        return Error{"--estimate needs frames to look at, expected --video CAMERA=SINK too (SINK may be none)"};
    const auto index = sensor_named(
        scene.cameras,
        options_.estimate_camera.empty() ? cameras_.front()->unit().camera().name : options_.estimate_camera,
        "camera", scene.file);
    if (!index) return index.error();
    const auto feed = std::ranges::find_if(
        cameras_, [&](const auto& f) { return f->unit().camera().name == scene.cameras[*index].name; });
    if (feed == cameras_.end())
        return Error{fmt::format("--estimate {}: this camera puts nothing out, expected --video {}=SINK too",
                                 scene.cameras[*index].name, scene.cameras[*index].name)};
    auto tracker = FrameTracker::create(*world_, *index, *options_.estimate);
    if (!tracker) return tracker.error();
    estimates_ = std::make_unique<EstimateFeed>(*std::move(tracker), *world_, *index);
    if (can_) estimates_->keep_reports();
    (*feed)->show_to(*estimates_);
    return options_.log_folder.empty() ? Status{Ok{}} : estimates_->log_to(options_.log_folder, options_.lockstep);
}

Status Emulator::run(const StopFlag& stop) {
    if (options_.lockstep) {
        run_lockstep(stop);
    } else {
        run_real_time(stop);
        t_ns_.store(std::min(clock_->now_ns(), end_ns_.load()), std::memory_order_relaxed);
    }
    if (no_priority_ || threads_->refused())
        notices_.push_back("no real-time priority (not permitted): wake-ups may be late under load");
    Status status = Ok{};
    for (const auto& feed : cameras_)
        if (auto done = feed->finish(); !done && status) status = done.error();
    for (const auto& feed : lidars_) feed->finish();
    if (estimates_)
        if (auto done = estimates_->finish(); !done && status) status = done.error();
    if (can_log_)
        if (auto done = can_log_->close(); !done && status) status = done.error();
    return status;
}

}  // namespace narpa
