#include "emulator/lidar_sensor.h"

#include <algorithm>

namespace narpa {

LidarSensor::LidarSensor(const World& world, std::size_t lidar, std::vector<std::unique_ptr<PacketSink>> sinks,
                         bool truth)
    : unit_(world, lidar, truth), sinks_(std::move(sinks)) {}

Status LidarSensor::log_to(const std::string& folder, bool wait_when_full) {
    auto log = SweepLog::create(folder, unit_.lidar().name, !unit_.truth().empty(), wait_when_full);
    if (!log) return log.error();
    log_ = *std::move(log);
    return Ok{};
}

void LidarSensor::start_at(std::int64_t t_ns) noexcept {
    next_ = unit_.first_packet_from(std::max<std::int64_t>(0, t_ns));
}

void LidarSensor::make_next(const Clock& clock) {
    const std::int64_t due = due_ns();
    stats_.wake_late.add(clock.now_ns() - due);
    const std::int64_t wall_start = monotonic_ns();
    unit_.fire(next_);
    stats_.fire.add(monotonic_ns() - wall_start);

    const std::span<const std::uint8_t> position = unit_.position(next_);
    for (const auto& sink : sinks_) {
        sink->send(PacketKind::data, unit_.bytes(), due);
        if (!position.empty()) sink->send(PacketKind::position, position, due);
    }

    const std::int64_t now = clock.now_ns();
    ++stats_.packets;
    stats_.shots += unit_.shots().size();
    stats_.returns += unit_.returns();
    stats_.hand_over.add(now - due);
    const bool late = now > due + unit_.packet_period_ns();
    stats_.late += late ? 1 : 0;
    if (log_) log_->add(unit_, next_, due, now, late, lost());
    ++next_;
    if (due_ns() + kMaxLagNs < now) {  // skip what is long overdue rather than send it in a burst
        const std::int64_t before = next_;
        start_at(now);
        const auto skipped = static_cast<std::uint64_t>(next_ - before);
        stats_.skipped += skipped;
        if (log_) log_->skip(skipped);
    }
}

std::uint64_t LidarSensor::drops() const noexcept {
    std::uint64_t n = 0;
    for (const auto& sink : sinks_) n += sink->counters().dropped;
    return n;
}

std::uint64_t LidarSensor::lost() const noexcept {
    std::uint64_t n = 0;
    for (const auto& sink : sinks_) n += sink->counters().dropped + sink->counters().receiver_dropped;
    return n;
}

Status LidarSensor::finish() {
    Status sent = finish_all(sinks_);
    const Status logged = log_ ? log_->close(lost()) : Status{Ok{}};
    return sent ? logged : sent;
}

}  // namespace narpa
