/// emulator/lidar_feed.h - a LiDAR on its way out: unit -> packet sinks at the instrument's own rate.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/lidar/packet_sink.h"
#include "emulator/clock.h"
#include "emulator/lidar_unit.h"
#include "emulator/log/histogram.h"

namespace narpa {

struct LidarStats {
    std::uint64_t packets = 0;
    std::uint64_t skipped = 0;  ///< never fired: the run was more than kMaxLagNs behind
    std::uint64_t shots = 0, returns = 0;
    Histogram wake_late, fire, hand_over;  ///< after it was due; duration; from due to sent
};

class LidarFeed {
public:
    LidarFeed(const World& world, std::size_t lidar, std::vector<std::unique_ptr<PacketSink>> sinks);

    /// The first packet whose first shot is at or after this time is next.
    void start_at(std::int64_t t_ns) noexcept;
    /// When the next packet is complete and goes out.
    [[nodiscard]] std::int64_t due_ns() const noexcept { return unit_.t_sent_ns(next_); }
    /// Fires the next packet and discards it: this triggers one-time allocations.
    void warm_up() noexcept { unit_.fire(next_); }
    /// `clock`: null in lockstep, where no wall time enters.
    void make_next(const Clock* clock) noexcept;

    [[nodiscard]] const LidarUnit& unit() const noexcept { return unit_; }
    [[nodiscard]] const LidarStats& stats() const noexcept { return stats_; }
    [[nodiscard]] double sweeps() const noexcept {
        return static_cast<double>(stats_.packets) * static_cast<double>(unit_.packet_period_ns()) * 1e-9 *
               unit_.lidar().rate_hz;
    }
    [[nodiscard]] const std::vector<std::unique_ptr<PacketSink>>& sinks() const noexcept { return sinks_; }
    void finish() noexcept {
        for (const auto& sink : sinks_) sink->flush();
    }

    static constexpr std::int64_t kMaxLagNs = 100'000'000;

private:
    LidarUnit unit_;
    std::vector<std::unique_ptr<PacketSink>> sinks_;
    std::int64_t next_ = 0;
    LidarStats stats_;
};

}  // namespace narpa
