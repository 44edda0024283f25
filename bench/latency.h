/// bench/latency.h - latency of a pose command over each bus, of a frame through each sink and of a LiDAR packet to
/// its receiver: from the call that sends it to the call that returns it complete, each on a thread of its own.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/pixel_format.h"
#include "base/result.h"
#include "base/stop.h"

namespace narpa {

struct LatencySettings {
    int count = 200;                           ///< measured messages, after a warm-up
    std::int64_t pause_ns = 5'000'000;         ///< between an arrival and the next message
    std::int64_t patience_ns = 5'000'000'000;  ///< after which a message counts as lost
    VideoFormat format{640, 480, PixelFormat::grey, 100'000'000};
};

struct LatencyRow {
    std::string what, by;  ///< "command, classic" by "slcan"
    std::vector<double> latencies_s;
    int lost = 0;
};

/// The two ends of a channel; messages are identified by their numbers. Both may block and allocate.
struct LatencyEnds {
    /// On the sender's thread, before the first `send`. Absent: nothing to do.
    std::function<Status()> join{};
    /// False: not accepted.
    std::function<bool(std::uint32_t number)> send;
    /// Waits for at most this time; returns the number of the message that has arrived, if any.
    std::function<std::optional<std::uint32_t>(std::int64_t timeout_ns)> receive;
};
/// Sends one message at a time. Errors: of `join`; no message arrived at all.
[[nodiscard]] Result<LatencyRow> measure_latency(const LatencyEnds& ends, const LatencySettings& settings,
                                                 const StopFlag& stop);

/// Pose commands, in classic frames and, where the bus has it, in one of CAN FD. `spec`: BUS of open_can_bus, with
/// "=BUS" behind it where the commander is on another (behind a USB adapter).
[[nodiscard]] Result<std::vector<LatencyRow>> measure_bus(const std::string& spec, const LatencySettings& settings,
                                                          const StopFlag& stop);
/// Frames. `spec`: SINK of open_video_sink, which this machine reads: V4L2 devices and FIFOs as they are (a FIFO
/// that is not there is made), `udp:HOST:PORT` and `rtp:HOST:PORT` at any of its addresses, a file by looking
/// whether the frame is in it; `uvc:PORT` and `bulk:` are attached here through vhci_hcd, for which the program is
/// to be root, `bulk:` with a bridge in software.
[[nodiscard]] Result<LatencyRow> measure_sink(const std::string& spec, const LatencySettings& settings,
                                              const StopFlag& stop);
/// LiDAR packets of 1206 bytes over UDP to a port of this machine.
[[nodiscard]] Result<LatencyRow> measure_packets(std::uint16_t port, const LatencySettings& settings,
                                                 const StopFlag& stop);

[[nodiscard]] nlohmann::json to_json(const LatencyRow& row);
/// A table, a line for each row.
[[nodiscard]] std::string to_text(const std::vector<LatencyRow>& rows);

}  // namespace narpa
