#include "emulator/lidar/lidar_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emulator/bus/can_node.h"
#include "emulator/log/mcap_log.h"

namespace narpa {

Status open_lidars(const World& world, const RunOptions& o, OpenSensors& out) {
    const Scene& scene = world.scene();
    if (!o.lidar.empty() && scene.lidars.empty()) return Error{"the scene has no LiDAR", scene.file};
    for (std::size_t i = 0; i < scene.lidars.size(); ++i) {
        const Lidar& lidar = scene.lidars[i];
        auto packets = o.lidar;
        const auto to_can = [&](const auto& output) {
            const DeviceKind* kind = packet_sink_kind(output.second);
            return kind != nullptr && kind->destination == Destination::bus && output.first == lidar.name;
        };
        const bool beams = std::erase_if(packets, to_can) > 0;
        if (beams)
            if (auto good = check_beams_on_can(lidar, !o.bus.empty(), scene.file); !good) return good;
        auto sinks = open_sinks<PacketSink>(
            packets, i, scene.lidars, "LiDAR", scene.file, out.kept_packets, [&](const auto& spec) {
                return open_packet_sink(spec, lidar.model->spec().network, o.lockstep, lidar.model->metadata());
            });
        if (!sinks) return sinks.error();
        if (sinks->empty() && !beams) continue;
        auto sensor = std::make_unique<LidarSensor>(world, i, *std::move(sinks), o.log_shots, o.on_packet);
        if (beams) sensor->keep_beams();
        out.lidars.push_back(sensor.get());
        out.all.push_back(std::move(sensor));
    }
    return Ok{};
}

LidarSensor::LidarSensor(const World& world, std::size_t lidar, std::vector<std::unique_ptr<PacketSink>> sinks,
                         bool log_shots, OnPacket on_packet)
    : world_(world),
      lidar_(static_cast<std::uint8_t>(lidar)),
      unit_(world, lidar, log_shots || on_packet),
      sinks_(std::move(sinks)),
      logs_shots_(log_shots),
      on_packet_(std::move(on_packet)) {}

Status LidarSensor::log_to(const std::string& folder, bool wait_when_full) {
    auto log = SweepLog::create(folder, unit_.lidar().name, logs_shots_, wait_when_full);
    if (!log) return log.error();
    log_ = *std::move(log);
    return Ok{};
}

void LidarSensor::record_to(McapLog& log) {
    mcap_ = &log.source_of_lidar(lidar_);
}

void LidarSensor::start_at(std::int64_t t_ns) noexcept {
    next_ = unit_.first_packet_from(std::max<std::int64_t>(0, t_ns));
}

void LidarSensor::make_next(const Clock& clock) {
    const std::int64_t due = due_ns();
    stats_.wake_late.add(clock.now_ns() - due);
    const std::int64_t wall_start = monotonic_ns();
    const RunUtc utc = clock.utc();
    const LidarUtc epoch{utc.zero_unix_ns, utc.synchronised};
    unit_.fire(next_, epoch);
    stats_.fire.add(monotonic_ns() - wall_start);

    const std::span<const std::uint8_t> position = unit_.position(next_, epoch);
    const std::int64_t unix_ns = epoch.unix_ns + due;
    for (const auto& sink : sinks_) {
        if (!unit_.bytes().empty()) sink->send(PacketKind::data, unit_.bytes(), unix_ns);
        if (!position.empty()) sink->send(PacketKind::position, position, unix_ns);
    }

    const std::int64_t now = clock.now_ns();
    ++stats_.packets;
    stats_.shots += unit_.shots().size();
    stats_.returns += unit_.returns();
    stats_.hand_over.add(now - due);
    const bool late = now > due + unit_.packet_period_ns();
    stats_.late += late ? 1 : 0;
    if (keeps_beams_) report_beams();
    if (on_packet_) on_packet_(unit_, next_);
    if (log_) log_->add(unit_, next_, due, now, utc, late, lost());
    if (mcap_) mcap_->packet(world_, lidar_, unit_, next_, now);
    ++next_;
    if (due_ns() + kMaxLagNs < now) {  // skip what is long overdue rather than send it in a burst
        const std::int64_t before = next_;
        start_at(now);
        const auto skipped = static_cast<std::uint64_t>(next_ - before);
        stats_.skipped += skipped;
        if (log_) log_->skip(skipped);
    }
}

std::vector<std::string> LidarSensor::outputs() const {
    auto texts = descriptions(sinks_);
    if (keeps_beams_) texts.emplace_back("CAN");
    return texts;
}

void LidarSensor::report_beams() noexcept {
    const std::int64_t start_ns = unit_.packet_start_ns(next_);
    const LidarSpec& spec = unit_.spec();
    for (std::size_t i = 0; i < unit_.shots().size(); ++i) {
        const LidarEcho echo = unit_.echoes()[i].reported(spec.returns)[0];
        LidarBeamReport report{.lidar = lidar_,
                               .beam = static_cast<std::uint16_t>(unit_.shots()[i].beam),
                               .t_ns = start_ns + unit_.shots()[i].t_offset_ns};
        if (echo.range_m > 0) {
            report.range_m = spec.range_resolution_m * std::round(echo.range_m / spec.range_resolution_m);
            if (spec.measures_velocity)
                report.velocity_m_s =
                    spec.velocity_resolution_m_s * std::round(echo.velocity_m_s / spec.velocity_resolution_m_s);
        }
        beams_lost_ += beams_.push(report) ? 0 : 1;
    }
}

void LidarSensor::send_telemetry(CanNode& can, std::int64_t t_ns, Heartbeat& /*faults*/) noexcept {
    for (LidarBeamReport report; beams_.pop(report);) can.send_numbered(report, t_ns);
}

std::uint64_t LidarSensor::drops() const noexcept {
    std::uint64_t n = 0;
    for (const auto& sink : sinks_) n += sink->counters().dropped;
    return n;
}

std::uint64_t LidarSensor::lost() const noexcept {
    std::uint64_t n = beams_lost_;
    for (const auto& sink : sinks_) n += sink->counters().dropped + sink->counters().receiver_dropped;
    return n;
}

Status LidarSensor::finish() {
    Status sent = finish_all(sinks_);
    const Status logged = log_ ? log_->close(lost()) : Status{Ok{}};
    return sent ? logged : sent;
}

Status check_beams_on_can(const Lidar& lidar, bool has_bus, const std::string& file) {
    if (!has_bus) return Error{fmt::format("--lidar {}=can needs --can BUS", lidar.name)};
    const LidarSpec& spec = lidar.model->spec();
    const double shots_hz =
        1e9 * static_cast<double>(spec.shots_per_packet) / static_cast<double>(spec.packet_period_ns);
    if (shots_hz <= LidarSensor::kMaxBeams_hz) return Ok{};
    return Error{
        fmt::format("--lidar {}=can: it fires {:.0f} shots a second, expected at most {:g} (each takes four CAN "
                    "frames)",
                    lidar.name, shots_hz, LidarSensor::kMaxBeams_hz),
        file};
}

}  // namespace narpa
