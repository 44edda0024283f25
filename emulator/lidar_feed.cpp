#include "emulator/lidar_feed.h"

#include <algorithm>

namespace narpa {

LidarFeed::LidarFeed(const World& world, std::size_t lidar, std::vector<std::unique_ptr<PacketSink>> sinks)
    : unit_(world, lidar), sinks_(std::move(sinks)) {}

void LidarFeed::start_at(std::int64_t t_ns) noexcept {
    next_ = unit_.first_packet_from(std::max<std::int64_t>(0, t_ns));
}

void LidarFeed::make_next(const Clock* clock) noexcept {
    const std::int64_t due = due_ns(), started = clock ? clock->now_ns() : due;
    const std::int64_t wall_start = monotonic_ns();
    unit_.fire(next_);
    stats_.fire.add(monotonic_ns() - wall_start);

    const std::span<const std::uint8_t> position = unit_.position(next_);
    for (const auto& sink : sinks_) {
        sink->send(PacketKind::data, unit_.bytes(), due);
        if (!position.empty()) sink->send(PacketKind::position, position, due);
    }

    const std::int64_t now = clock ? clock->now_ns() : due;
    ++stats_.packets;
    stats_.shots += unit_.shots().size();
    stats_.returns += unit_.returns();
    stats_.wake_late.add(started - due);
    stats_.hand_over.add(now - due);
    ++next_;
    if (clock && due_ns() + kMaxLagNs < now) {  // hopelessly behind: let go rather than burst
        const std::int64_t before = next_;
        start_at(now);
        stats_.skipped += static_cast<std::uint64_t>(next_ - before);
    }
}

}  // namespace narpa
