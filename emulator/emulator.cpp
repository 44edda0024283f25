#include "emulator/emulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "emulator/log/run_record.h"
#include "emulator/scene_sensors.h"
#include "emulator/telemetry.h"
#include "emulator/threads.h"

namespace narpa {
namespace {

/// A time budget needs real time, and is at most the camera's period. (The scene reader checks the scene's own.)
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
        return Error{"no output, expected at least one --video CAMERA=SINK or --lidar LIDAR=SINK"};
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
    if (options.duration_s > 0) emulator->end_ns_ = std::llround(options.duration_s * 1e9);
    emulator->threads_ = std::make_unique<TracingThreads>(options.threads, options.cpus);
    if (auto opened = emulator->open(); !opened) return opened.error();
    return emulator;
}

Status Emulator::open() {
    const bool logs = !options_.log_folder.empty();
    if (logs) {
        std::error_code error;
        std::filesystem::create_directories(options_.log_folder, error);
        if (error) return Error{"cannot create folder: " + error.message(), options_.log_folder};
        if (auto recorded = write_run_record(options_.log_folder, world_->scene()); !recorded)
            return recorded.error();
    }
    if (!options_.bus.empty()) {
        auto bus = open_can_bus(options_.bus, CanRole::hub);
        if (!bus) return bus.error();
        bus_ = *std::move(bus);
        if (logs) {
            auto log = RowLog::create(options_.log_folder + "/can.log", "", options_.lockstep);
            if (!log) return log.error();
            can_log_ = *std::move(log);
        }
        can_ = std::make_unique<CanNode>(*world_, *bus_, can_log_.get(), !options_.lockstep);
    }
    auto sensors = open_sensors(*world_, options_, can_ != nullptr);
    if (!sensors) return sensors.error();
    sensors_ = *std::move(sensors);
    if (options_.estimate) {
        auto estimator = open_estimator(*world_, options_, sensors_, can_ != nullptr);
        if (!estimator) return estimator.error();
        estimator_ = *std::move(estimator);
    }
    telemetry_ = std::make_unique<Telemetry>(can_.get(), sensors_, estimator_.get());
    return Ok{};
}

Status Emulator::run(const StopFlag& stop) {
    options_.lockstep ? run_lockstep(stop) : run_real_time(stop);
    if (no_priority_ || threads_->refused())
        notices_.push_back("no real-time priority (not permitted): wake-ups may be late under load");
    Status status = Ok{};
    const auto keep_first = [&](const Status& done) {
        if (!done && status) status = done.error();
    };
    for (const auto& sensor : sensors_) keep_first(sensor->finish());
    if (estimator_) keep_first(estimator_->finish());
    if (can_log_) keep_first(can_log_->close());
    return status;
}

}  // namespace narpa
