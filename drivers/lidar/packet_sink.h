/// drivers/lidar/packet_sink.h - where LiDAR packets go: UDP, a capture file, or nowhere.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"
#include "drivers/device_kind.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa {

struct PacketCounters {
    std::uint64_t sent = 0;
    std::uint64_t dropped = 0;  ///< socket buffer full, no receiver, disk full
    /// Of the packets sent by UDP: lost at a receiver on this machine, whose socket buffer was full.
    std::uint64_t receiver_dropped = 0;
};

/// Each kind has its own port (LidarNetwork). `udp:HOST:PORT` sets the data port; position packets keep their
/// offset from it.
enum class PacketKind : std::uint8_t { data, position };

class PacketSink {
public:
    virtual ~PacketSink() = default;
    /// Sends one datagram. Never blocks. `unix_ns` is the UTC at which the instrument would send it;
    /// a capture stamps the packet with it.
    virtual bool send(PacketKind kind, std::span<const std::uint8_t> payload, std::int64_t unix_ns) noexcept = 0;
    /// Waits, at most a second, until what was sent is written; then the counters are final. Before,
    /// `receiver_dropped` may be half a second old.
    virtual void flush() noexcept = 0;
    [[nodiscard]] virtual PacketCounters counters() const noexcept = 0;
    /// An Error when the sink is a file that did not take every packet; final after a flush.
    [[nodiscard]] virtual Status failure() const { return Ok{}; }
    [[nodiscard]] virtual std::string description() const = 0;
    /// What became of the packets that `sent` counts, for messages: "sent", "written".
    [[nodiscard]] virtual std::string_view fate() const { return "sent"; }
};

/// SINK: a text of one of the kinds in open_packet_sink.cpp. A capture shows the packets as `network` sends them by
/// default. `wait_when_full`: a lockstep run
/// waits for the disk where a real-time run drops. `metadata`: LidarModel::metadata(); if not empty, it is written
/// to FILE.json beside a capture. `ouster:` emulates a sensor on the network: an HTTP server at ADDRESS (default
/// 127.0.0.1) serves the metadata and accepts the packets' destination; until then packets are discarded and not
/// counted.
Result<std::unique_ptr<PacketSink>> open_packet_sink(std::string_view spec, const LidarNetwork& network,
                                                     bool wait_when_full, std::string_view metadata = {});
/// The kind that a text names; null: none.
[[nodiscard]] const DeviceKind* packet_sink_kind(const std::string& spec);
/// All kinds, for --help.
[[nodiscard]] std::string packet_sink_help();

}  // namespace narpa
