/// rehearsal/navigation/sweep_buffer.h - a LiDAR's packets in the order of arrival, and the last turn out of them.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/scene/scene.h"

namespace narpa::rehearsal {

class SweepBuffer {
public:
    /// `epoch_unix_ns`: UTC of simulation time 0.
    SweepBuffer(const Lidar& lidar, std::int64_t epoch_unix_ns);

    /// Keeps a datagram; `reference_ns`: simulation time within half an hour of it. False, and counted, where it is
    /// no data packet of the LiDAR's model.
    bool take(std::span<const std::uint8_t> bytes, std::int64_t reference_ns);
    /// No packet that is complete by t_ns is missing at the end.
    [[nodiscard]] bool complete_to(std::int64_t t_ns) const noexcept;
    /// Returns of the turn that ends at t_ns, of complete packets in the order of arrival; times count from t_ns.
    void turn(std::int64_t t_ns, std::vector<RangePoint>& out) const;

    [[nodiscard]] std::uint64_t received() const noexcept { return received_; }
    [[nodiscard]] std::uint64_t bad() const noexcept { return bad_; }

private:
    struct Packet {
        std::int64_t t_ns;  ///< of its first shot
        std::vector<std::uint8_t> bytes;
    };
    /// The packet's exact start: its time stamp is rounded down.
    [[nodiscard]] std::int64_t start_ns(std::int64_t stamp_ns) const noexcept;

    const LidarModel* model_;
    double rate_hz_;
    std::int64_t turn_ns_, period_ns_, epoch_unix_ns_;
    std::deque<Packet> packets_;
    std::uint64_t received_ = 0, bad_ = 0;
};

}  // namespace narpa::rehearsal
