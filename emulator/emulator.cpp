#include "emulator/emulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>

#include "drivers/can/redundant_bus.h"
#include "drivers/lidar/packet_sink.h"
#include "drivers/video/video_sink.h"
#include "emulator/camera/camera_sensor.h"
#include "emulator/lidar/lidar_sensor.h"
#include "emulator/log/run_record.h"
#include "emulator/threads.h"
#include "protocols/can/pose_map.h"

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

}  // namespace

Emulator::Emulator() = default;
Emulator::~Emulator() = default;

Result<std::unique_ptr<Emulator>> Emulator::create(Scene scene, const RunOptions& options,
                                                   std::span<const SensorKind> kinds) {
    if (options.lockstep && options.bus.empty())
        return Error{"--lockstep needs --can BUS: the clock advances only with commands"};
    if (auto good = check_budget(scene, options); !good) return good.error();
    if (auto good = check_destinations(options); !good) return good.error();
    auto world = World::create(std::move(scene));
    if (!world) return world.error();
    if (options.lockstep && (*world)->scene().time.source == TimeSettings::Source::system)
        return Error{"in lockstep no wall time enters any result: expected source = \"free\" in [time]",
                     (*world)->scene().file};
    if (options.lockstep)
        for (const Body& body : (*world)->scene().bodies)
            if (body.can_map && !body.can_map->time)
                return Error{
                    fmt::format("lockstep needs the time of each command: expected a `time` in can_pose of body "
                                "\"{}\"",
                                body.name),
                    (*world)->scene().file};
    if (options.lockstep && !(*world)->has_commanded_bodies())
        return Error{"--lockstep needs a body with a can_id", (*world)->scene().file};

    std::unique_ptr<Emulator> emulator(new Emulator);
    emulator->options_ = options;
    emulator->kinds_ = kinds;
    emulator->take_world(*std::move(world));
    if (options.duration_s > 0) emulator->end_ns_ = std::llround(options.duration_s * 1e9);
    emulator->threads_ = std::make_unique<TracingThreads>(options.threads, options.cpus);
    if (auto opened = emulator->open(); !opened) return opened.error();
    return emulator;
}

Result<std::unique_ptr<Emulator>> Emulator::create_next(std::unique_ptr<Emulator> ended,
                                                        const RunOptions& options) {
    const Restart restart = *ended->can_->restart();
    std::unique_ptr<Emulator> emulator(new Emulator);
    emulator->options_ = options;
    emulator->kinds_ = ended->kinds_;
    emulator->end_ns_ = ended->end_ns_;
    emulator->threads_ = std::move(ended->threads_);
    emulator->bus_ = std::move(ended->bus_);
    for (CameraSensor* camera : ended->sensors_.cameras)
        emulator->sensors_.kept_video[std::string(camera->name())] = camera->take_sinks();
    for (LidarSensor* lidar : ended->sensors_.lidars)
        emulator->sensors_.kept_packets[std::string(lidar->name())] = lidar->take_sinks();
    emulator->take_world(std::move(ended->world_));
    ended.reset();  // its sensors refer to the world
    emulator->world_->restart();
    if (auto opened = emulator->open(); !opened) return opened.error();
    emulator->can_->begin_with(restart);
    emulator->lockstep_.moved = true;
    return emulator;
}

void Emulator::take_world(std::unique_ptr<World> world) {
    world_ = std::move(world);
    if (const TimeSettings& time = world_->scene().time; time.source == TimeSettings::Source::system) {
        system_utc_ = std::make_unique<SystemUtc>();
        ptp4l_ = std::make_unique<Ptp4lWatch>(time.ptp4l, static_cast<std::uint8_t>(time.ptp4l_domain));
    }
    lockstep_.clock.set_epoch(world_->scene().epoch_unix_ns);
    utc_ = lockstep_.clock.utc();
}

Status Emulator::open() {
    const bool logs = !options_.log_folder.empty();
    if (logs) {  // sinks may be files in it
        std::error_code error;
        std::filesystem::create_directories(options_.log_folder, error);
        if (error) return Error{"cannot create folder: " + error.message(), options_.log_folder};
    }
    if (!options_.bus.empty() && !bus_) {
        auto bus = open_can_bus(options_.bus, CanRole::hub);
        if (!bus) return bus.error();
        bus_ = *std::move(bus);
        const CanSettings& can = world_->scene().can;
        bus_->set_redundancy(
            {can.redundancy == CanSettings::Redundancy::cold, can.heartbeat_id, can.heartbeat_timeout_ns});
    }
    for (const SensorKind& kind : kinds_)
        if (auto opened = kind.open(*world_, options_, sensors_); !opened) return opened;
    if (sensors_.all.empty())
        return Error{"no output, expected at least one --video CAMERA=SINK or --lidar LIDAR=SINK"};
    if (auto opened = open_observers(); !opened) return opened;
    if (!options_.mcap.empty())
        if (auto opened = open_mcap(); !opened) return opened;
    if (auto opened = open_pulses(); !opened) return opened;
    if (logs)  // last, so that a run that cannot start keeps the log of an earlier one
        if (auto opened = open_logs(); !opened) return opened;
    if (!bus_) return Ok{};
    can_ = std::make_unique<CanNode>(*world_, *bus_, can_log_.get(), options_.lockstep);
    for (const auto& sensor : sensors_.all) sensor->connect(*can_);
    return Ok{};
}

Status Emulator::open_observers() {
    std::vector<std::size_t> cameras;
    for (const CameraSensor* camera : sensors_.cameras) cameras.push_back(camera->index());
    for (const OpenFrameObserver& open : options_.observers) {
        auto observer = open(*world_, cameras, options_.lockstep);
        if (!observer) return observer.error();
        const auto camera = std::ranges::find(sensors_.cameras, (*observer)->camera(), &CameraSensor::index);
        assert(camera != sensors_.cameras.end() && "an observer's camera has a sink");
        observers_.push_back(std::make_unique<FrameFeed>(*std::move(observer), *world_, options_.lockstep));
        (*camera)->feed(*observers_.back());
    }
    return Ok{};
}

Status Emulator::open_logs() {
    const std::string& folder = options_.log_folder;
    if (auto removed = remove_run(folder); !removed) return removed;
    if (auto recorded = write_run_record(folder, world_->scene()); !recorded) return recorded;
    for (const auto& sensor : sensors_.all)
        if (auto opened = sensor->log_to(folder, options_.lockstep); !opened) return opened;
    for (const auto& feed : observers_)
        if (auto opened = feed->observer().log_to(folder, options_.lockstep); !opened) return opened;
    if (!bus_) return Ok{};
    auto log = RowLog::create(folder + "/can.log", "", options_.lockstep, CanNode::kLogLines);
    if (!log) return log.error();
    can_log_ = *std::move(log);
    return Ok{};
}

Status Emulator::open_mcap() {
    std::vector<std::size_t> cameras, lidars;
    for (const CameraSensor* camera : sensors_.cameras) cameras.push_back(camera->index());
    for (const LidarSensor* lidar : sensors_.lidars) lidars.push_back(lidar->index());
    auto log = McapLog::create(options_.mcap, world_->scene(), cameras, lidars, options_.lockstep);
    if (!log) return log.error();
    mcap_ = *std::move(log);
    for (const auto& sensor : sensors_.all) sensor->record_to(*mcap_);
    for (const auto& feed : observers_) feed->observer().record_to(*mcap_);
    return Ok{};
}

Status Emulator::open_pulses() {
    const bool any = !options_.triggers.empty() || !options_.second_pulses.empty();
    if (any && options_.lockstep) return Error{"pulses on lines and datagrams have no place in lockstep"};
    if (!options_.triggers.empty() && !bus_)
        return Error{"cameras are triggered as they are commanded, expected a --can BUS beside --trigger"};
    const bool obeys =
        std::ranges::any_of(world_->scene().cameras, [](const Camera& c) { return c.control.has_value(); });
    if (!options_.triggers.empty() && !obeys)
        return Error{"no camera can be triggered, expected control = {trigger = \"external\"} of one",
                     world_->scene().file};
    for (const std::string& spec : options_.triggers) {
        auto source = open_pulse_source(spec);
        if (!source) return source.error();
        triggers_.push_back(*std::move(source));
    }
    if (options_.second_pulses.empty()) return Ok{};
    auto line = open_pulse_sink(options_.second_pulses);
    if (!line) return line.error();
    second_pulses_ = std::make_unique<SecondPulses>(*std::move(line));
    return Ok{};
}

std::vector<std::string> Emulator::notices_of(const PoseRefusals& refusals) const {
    std::vector<std::string> notices;
    if (refusals.too_far_ahead > 0)
        notices.push_back(
            fmt::format("pose commands refused because they are for more than {:g} s ahead (command_ahead_max_s in "
                        "[render]): {}",
                        world_->scene().render.command_ahead_max_s, refusals.too_far_ahead));
    for (const RefusedPoses& r : refusals.bodies) {
        const auto body = std::ranges::find(world_->scene().bodies, r.can_id, &Body::can_id);
        notices.push_back(
            fmt::format("pose commands of \"{}\" (can_id {:#x}) refused: {} as past (not newer than its newest, "
                        "for {:.3f} s), {} "
                        "as overrun (more than are kept); check the sender's clock and rate",
                        body->name, r.can_id, r.past, static_cast<double>(r.newest_ns) * 1e-9, r.overrun));
    }
    return notices;
}

void Emulator::report_refusals(const PoseRefusals& refusals) const {
    for (const std::string& what : notices_of(refusals))
        if (options_.on_refusal) options_.on_refusal(what);
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

void Emulator::note_clock() {
    if (!system_utc_) return;
    if (!utc_.synchronised)
        notices_.push_back(
            "nothing disciplines the system's clock (no ptp4l with phc2sys, chrony or ntpd): the UTC of "
            "time stamps is as it was set");
    if (const std::uint32_t steps = system_utc_->steps(); steps > 0)
        notices_.push_back(
            fmt::format("the system's clock was stepped during the run, {} times, last by {:+.6f} s; UTC "
                        "in time stamps followed, exposures did not move",
                        steps, 1e-9 * static_cast<double>(system_utc_->last_step_ns())));
}

void Emulator::note_losses() {
    if (!can_) return;
    if (const std::string bodies = bodies_without_a_pose(); !bodies.empty() && !options_.lockstep)
        notices_.push_back(
            fmt::format("no pose command was accepted for {}; such a body moves as the scene states", bodies));
    PoseRefusals refusals;
    can_->refusals(refusals);
    for (std::string& what : notices_of(refusals)) notices_.push_back(std::move(what));
    if (const std::uint64_t n = can_->counters().not_logged; n > 0)
        notices_.push_back(
            fmt::format("frames of others that are not in can.log, because there were more than {} a second or the "
                        "disk was slow: {}",
                        CanNode::kOtherFramesPerSecond, n));
}

Status Emulator::run(const StopFlag& stop) {
    options_.lockstep ? run_lockstep(stop) : run_real_time(stop);
    stopped_ = stop.load(std::memory_order_relaxed);
    return finish();
}

Status Emulator::finish() {
    if (no_priority_ || threads_->refused())
        notices_.push_back("no real-time priority (not permitted): wake-ups may be late under load");
    note_clock();
    note_losses();
    Status status = Ok{};
    const auto keep_first = [&](const Status& done) {
        if (!done && status) status = done.error();
    };
    for (const auto& sensor : sensors_.all) keep_first(sensor->finish());
    for (const auto& feed : observers_) keep_first(feed->observer().finish());
    if (can_log_) keep_first(can_log_->close());
    if (mcap_) {
        keep_first(mcap_->close());
        if (const std::uint64_t n = mcap_->dropped(); n > 0)
            notices_.push_back(fmt::format(
                "frames and packets that are not in {}, because the disk or the compression was too slow: {}",
                mcap_->path(), n));
    }
    return status;
}

}  // namespace narpa
