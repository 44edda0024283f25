#include "emulator/emulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "emulator/camera_sensor.h"
#include "emulator/lidar_sensor.h"
#include "emulator/log/run_record.h"
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

/// Two writers of one file or device would overwrite each other's items; packets of two LiDARs to one port could
/// not be told apart, as they come from one address.
Status check_destinations(const RunOptions& options) {
    std::set<std::string> taken;
    const auto take = [&](const char* flag, const auto& outputs, const auto& kind_of) -> Status {
        for (const auto& [name, sink] : outputs) {
            const DeviceKind* kind = kind_of(sink);
            const std::string place = kind ? kind->place_of(sink) : "";
            if (!place.empty() && !taken.insert(place).second)
                return Error{
                    fmt::format("{} {}={}: another output goes there too, expected a {} of its own for each", flag,
                                name, sink, kind->destination == Destination::port ? "port" : "file or device")};
        }
        return Ok{};
    };
    if (auto good = take("--video", options.video, video_sink_kind); !good) return good;
    return take("--lidar", options.lidar, packet_sink_kind);
}

/// Opens the sinks of sensor `index`, in the order in which they were given.
template <class Sink>
Result<std::vector<std::unique_ptr<Sink>>> open_sinks(
    const std::vector<std::pair<std::string, std::string>>& outputs, std::size_t index, const auto& sensors,
    std::string_view kind, const std::string& file, const auto& open) {
    std::vector<std::unique_ptr<Sink>> sinks;
    for (const auto& [name, spec] : outputs) {
        auto named = sensor_named(sensors, name, kind, file);
        if (!named) return named.error();
        if (*named != index) continue;
        Result<std::unique_ptr<Sink>> sink = open(spec);
        if (!sink) return sink.error();
        sinks.push_back(*std::move(sink));
    }
    return sinks;
}

/// The settings that readers of the camera's frames may change. Their requests are handled like commands on CAN, so
/// without a bus there are none.
std::optional<VideoControls> controls_of(const Camera& c, bool has_bus) {
    if (!c.control || !has_bus) return std::nullopt;
    const CameraSettings s = settings_of(c);
    return VideoControls{c.control->exposure_min_ns,
                         std::min(c.control->exposure_max_ns, c.period_ns - rows_ns(c) - 1),
                         s.exposure_ns,
                         c.control->gain_max_cdb,
                         s.gain_cdb,
                         s.auto_exposure};
}

Result<std::unique_ptr<Sensor>> open_camera(const World& world, std::size_t index, const RunOptions& o,
                                            bool telemetry) {
    const Scene& scene = world.scene();
    const Camera& c = scene.cameras[index];
    const VideoFormat format{c.width, c.height, c.format, c.period_ns};
    const WhenFull when_full = o.lockstep ? WhenFull::wait : WhenFull::drop;
    const auto controls = controls_of(c, !o.bus.empty());
    auto sinks = open_sinks<VideoSink>(
        o.video, index, scene.cameras, "camera", scene.file,
        [&](const std::string& spec) { return open_video_sink(spec, format, when_full, controls); });
    if (!sinks) return sinks.error();
    if (sinks->empty()) return std::unique_ptr<Sensor>();
    auto camera = std::make_unique<CameraSensor>(world, index, *std::move(sinks));
    if (telemetry) camera->keep_ledgers();
    return std::unique_ptr<Sensor>(std::move(camera));
}

Result<std::unique_ptr<Sensor>> open_lidar(const World& world, std::size_t index, const RunOptions& o,
                                           bool /*telemetry*/) {
    const Scene& scene = world.scene();
    auto packets = o.lidar;
    const auto to_can = [&](const auto& output) {
        const DeviceKind* kind = packet_sink_kind(output.second);
        return kind && kind->destination == Destination::bus && output.first == scene.lidars[index].name;
    };
    const bool beams = std::erase_if(packets, to_can) > 0;
    if (beams)
        if (auto good = check_beams_on_can(scene.lidars[index], !o.bus.empty(), scene.file); !good)
            return good.error();
    auto sinks =
        open_sinks<PacketSink>(packets, index, scene.lidars, "LiDAR", scene.file, [&](const std::string& spec) {
            const LidarModel& model = *scene.lidars[index].model;
            return open_packet_sink(spec, model.spec().network, scene.epoch_unix_ns, o.lockstep, model.metadata());
        });
    if (!sinks) return sinks.error();
    if (sinks->empty() && !beams) return std::unique_ptr<Sensor>();
    auto lidar = std::make_unique<LidarSensor>(world, index, *std::move(sinks), o.log_shots);
    if (beams) lidar->keep_beams();
    return std::unique_ptr<Sensor>(std::move(lidar));
}

/// The sensors for which the options name sinks; a new kind is opened here. `telemetry`: they keep ledgers for the
/// CAN bus. Errors name sensor, sink or file.
Result<std::vector<std::unique_ptr<Sensor>>> open_sensors(const World& world, const RunOptions& options,
                                                          bool telemetry) {
    const Scene& scene = world.scene();
    if (!options.video.empty() && scene.cameras.empty()) return Error{"the scene has no camera", scene.file};
    if (!options.lidar.empty() && scene.lidars.empty()) return Error{"the scene has no LiDAR", scene.file};
    std::vector<std::unique_ptr<Sensor>> sensors;
    for (const auto& [count, open] :
         {std::pair{scene.cameras.size(), &open_camera}, std::pair{scene.lidars.size(), &open_lidar}}) {
        for (std::size_t i = 0; i < count; ++i) {
            auto sensor = open(world, i, options, telemetry);
            if (!sensor) return sensor.error();
            if (*sensor) sensors.push_back(*std::move(sensor));  // a sensor without a sink costs nothing
        }
    }
    return sensors;
}

/// The estimator of the options, attached to its camera among `sensors`.
Result<std::unique_ptr<OnlineEstimator>> open_estimator(const World& world, const RunOptions& options,
                                                        const std::vector<std::unique_ptr<Sensor>>& sensors,
                                                        bool telemetry) {
    const Scene& scene = world.scene();
    std::vector<CameraSensor*> cameras;
    for (const auto& sensor : sensors)
        if (auto* camera = dynamic_cast<CameraSensor*>(sensor.get())) cameras.push_back(camera);
    if (cameras.empty())
        return Error{"--estimate needs a camera, expected --video CAMERA=SINK too (SINK may be none)"};
    const std::string name =
        options.estimate_camera.empty() ? std::string(cameras.front()->name()) : options.estimate_camera;
    const auto index = sensor_named(scene.cameras, name, "camera", scene.file);
    if (!index) return index.error();
    for (CameraSensor* camera : cameras) {
        if (camera->name() != name) continue;
        auto tracker = FrameTracker::create(world, *index, *options.estimate);
        if (!tracker) return tracker.error();
        auto estimator = std::make_unique<OnlineEstimator>(*std::move(tracker), world, *index, options.lockstep);
        if (telemetry) estimator->keep_reports();
        camera->show_to(*estimator);
        return estimator;
    }
    return Error{fmt::format("--estimate {}: this camera has no sink, expected --video {}=SINK too", name, name)};
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
    if (auto good = check_destinations(options); !good) return good.error();
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
    if (logs) {  // sinks may be files in it
        std::error_code error;
        std::filesystem::create_directories(options_.log_folder, error);
        if (error) return Error{"cannot create folder: " + error.message(), options_.log_folder};
    }
    if (!options_.bus.empty()) {
        auto bus = open_can_bus(options_.bus, CanRole::hub);
        if (!bus) return bus.error();
        bus_ = *std::move(bus);
    }
    auto sensors = open_sensors(*world_, options_, bus_ != nullptr);
    if (!sensors) return sensors.error();
    sensors_ = *std::move(sensors);
    if (options_.estimate) {
        auto estimator = open_estimator(*world_, options_, sensors_, bus_ != nullptr);
        if (!estimator) return estimator.error();
        estimator_ = *std::move(estimator);
    }
    if (logs)  // last, so that a run that cannot start keeps the log of an earlier one
        if (auto opened = open_logs(); !opened) return opened;
    if (!bus_) return Ok{};
    can_ = std::make_unique<CanNode>(*world_, *bus_, can_log_.get(), options_.lockstep);
    for (const auto& sensor : sensors_)
        if (auto* camera = dynamic_cast<CameraSensor*>(sensor.get()); camera && camera->control())
            can_->operate(*camera->control());
    return Ok{};
}

Status Emulator::open_logs() {
    const std::string& folder = options_.log_folder;
    if (auto removed = remove_run(folder); !removed) return removed;
    if (auto recorded = write_run_record(folder, world_->scene()); !recorded) return recorded;
    for (const auto& sensor : sensors_)
        if (auto opened = sensor->log_to(folder, options_.lockstep); !opened) return opened;
    if (estimator_)
        if (auto opened = estimator_->log_to(folder); !opened) return opened;
    if (!bus_) return Ok{};
    auto log = RowLog::create(folder + "/can.log", "", options_.lockstep, CanNode::kLogLines);
    if (!log) return log.error();
    can_log_ = *std::move(log);
    return Ok{};
}

std::vector<std::string> Emulator::refusals() const {
    std::vector<std::string> notices;
    if (can_->too_far_ahead() > 0)
        notices.push_back(
            fmt::format("pose commands refused because they are for more than {:g} s ahead (command_ahead_max_s in "
                        "[render]): {}",
                        world_->scene().render.command_ahead_max_s, can_->too_far_ahead()));
    for (const RefusedPoses& r : can_->refused_poses()) {
        const auto body = std::ranges::find(world_->scene().bodies, r.can_id, &Body::can_id);
        notices.push_back(
            fmt::format("pose commands of \"{}\" (can_id {:#x}) refused: {} as past (not newer than its newest, "
                        "for {:.3f} s), {} "
                        "as overrun (more than are kept); check the sender's clock and rate",
                        body->name, r.can_id, r.past, static_cast<double>(r.newest_ns) * 1e-9, r.overrun));
    }
    return notices;
}

std::string Emulator::bodies_without_a_pose() const {
    std::string text;
    const std::vector<Body>& bodies = world_->scene().bodies;
    for (std::size_t i = 0; can_ && i < bodies.size(); ++i)
        if (const PoseTrack* track = std::as_const(*world_).track(i); track && !track->commanded())
            text +=
                fmt::format("{}\"{}\" (can_id {:#x})", text.empty() ? "" : ", ", bodies[i].name, *bodies[i].can_id);
    return text;
}

void Emulator::note_losses() {
    if (!can_) return;
    if (const std::string bodies = bodies_without_a_pose(); !bodies.empty() && !options_.lockstep)
        notices_.push_back(
            fmt::format("no pose command was accepted for {}; such a body moves as the scene states", bodies));
    for (std::string& what : refusals()) notices_.push_back(std::move(what));
    if (const std::uint64_t n = can_->counters().not_logged; n > 0)
        notices_.push_back(
            fmt::format("frames of others that are not in can.log, because there were more than {} a second or the "
                        "disk was slow: {}",
                        CanNode::kOtherFramesPerSecond, n));
}

Status Emulator::run(const StopFlag& stop) {
    options_.lockstep ? run_lockstep(stop) : run_real_time(stop);
    stopped_ = stop.load(std::memory_order_relaxed);
    if (no_priority_ || threads_->refused())
        notices_.push_back("no real-time priority (not permitted): wake-ups may be late under load");
    note_losses();
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
