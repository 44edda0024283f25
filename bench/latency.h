/// bench/latency.h - how long a pose command needs over each bus, a frame through each sink and a LiDAR packet to
/// its receiver: from the call that hands it over to the call that has it whole, each on a thread of its own.
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
    int count = 200;                           ///< that are measured, after some that are not
    std::int64_t pause_ns = 5'000'000;         ///< between an arrival and the next
    std::int64_t patience_ns = 5'000'000'000;  ///< after which one counts as lost
    VideoFormat format{640, 480, PixelFormat::grey, 100'000'000};
};

struct LatencyRow {
    std::string what, by;  ///< "command, classic" by "slcan"
    std::vector<double> latencies_s;
    int lost = 0;
};

/// The two ends of one way; the numbers tell what is sent apart. Both wait and allocate as they like.
struct LatencyEnds {
    /// On the sender's thread, before the first `send`. Absent: nothing to do.
    std::function<Status()> join{};
    /// False: not taken.
    std::function<bool(std::uint32_t number)> send;
    /// Waits at most so long; the number of what has come.
    std::function<std::optional<std::uint32_t>(std::int64_t timeout_ns)> receive;
};
/// One at a time. Errors: of `join`; nothing came at all.
[[nodiscard]] Result<LatencyRow> measure_latency(const LatencyEnds& ends, const LatencySettings& settings,
                                                 const StopFlag& stop);

/// Pose commands, in classic frames and, where the bus has it, in one of CAN FD. `spec`: BUS of open_can_bus, with
/// "=BUS" behind it where the commander is on another (behind a USB adapter).
[[nodiscard]] Result<std::vector<LatencyRow>> measure_bus(const std::string& spec, const LatencySettings& settings,
                                                          const StopFlag& stop);
/// Frames. `spec`: SINK of open_video_sink, which this machine reads: V4L2 devices and FIFOs as they are (a FIFO
/// that is not there is made), a file by looking whether the frame is in it; `uvc:PORT` and `bulk:` are attached
/// here through vhci_hcd, for which the program is to be root, `bulk:` with a bridge in software.
[[nodiscard]] Result<LatencyRow> measure_sink(const std::string& spec, const LatencySettings& settings,
                                              const StopFlag& stop);
/// LiDAR packets of 1206 bytes over UDP to a port of this machine.
[[nodiscard]] Result<LatencyRow> measure_packets(std::uint16_t port, const LatencySettings& settings,
                                                 const StopFlag& stop);

[[nodiscard]] nlohmann::json to_json(const LatencyRow& row);
/// A table, a line for each row.
[[nodiscard]] std::string in_words(const std::vector<LatencyRow>& rows);

}  // namespace narpa
