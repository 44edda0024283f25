/// drivers/can/can_bus.h - one small interface for every CAN bus: SocketCAN, the slcan hub, UDP multicast, logs.
///
/// Nothing here blocks, allocates or throws after `open_can_bus`: what cannot be sent or stored is dropped and
/// counted, and a bus that goes away (interface down, client gone) is waited for, not given up.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "base/result.h"
#include "protocols/can/frame.h"

namespace narpa {

/// What a bus has met since it was opened.
struct CanCounters {
    std::uint64_t received = 0;
    std::uint64_t sent = 0;
    std::uint64_t send_drops = 0;        ///< queue full, no client, interface down, FD on a classic bus
    std::uint64_t receive_overflow = 0;  ///< frames that the kernel or a full buffer threw away before we saw them
    std::uint64_t malformed = 0;         ///< lines or datagrams that are no CAN frame
    std::uint64_t error_frames = 0;      ///< controller error reports
    std::uint64_t bus_off = 0;           ///< times that the controller went bus-off
    std::uint64_t interface_down = 0;    ///< times that the interface or the connection went away
};

/// A frame and when it arrived (CLOCK_MONOTONIC, ns). For a log: the stamp of its line since the first line.
struct ReceivedFrame {
    CanFrame frame{};
    std::int64_t t_received_ns = 0;
};

class CanBus {
public:
    virtual ~CanBus() = default;

    /// The next waiting frame; false when there is none now. Error frames are counted, not returned.
    [[nodiscard]] virtual bool receive(ReceivedFrame& out) noexcept = 0;
    /// False: dropped and counted.
    virtual bool send(const CanFrame& frame) noexcept = 0;
    /// Waits until `receive` may have something or the time is over; -1 waits for ever. May wake early.
    virtual void wait(std::int64_t timeout_ns) noexcept = 0;
    /// No frame will ever come again (the end of a log).
    [[nodiscard]] virtual bool ended() const noexcept { return false; }
    /// Frames are a recording: all there at once, `t_received_ns` says when each is due.
    [[nodiscard]] virtual bool recorded() const noexcept { return false; }
    [[nodiscard]] virtual bool carries_fd() const noexcept = 0;
    /// How a client reaches this bus, for people: "slcan: 127.0.0.1:29537 and /dev/pts/3".
    [[nodiscard]] virtual std::string description() const = 0;
    [[nodiscard]] const CanCounters& counters() const noexcept { return counters_; }

protected:
    CanCounters counters_{};
};

/// `hub` is the side of `narpa run`; `client` the side of those who command it (`narpa fly`). They differ where
/// a bus has a server (slcan) or a direction (log: a hub reads it, a client writes it).
enum class CanRole : std::uint8_t { hub, client };

/// BUS: `vcan0`/`can0` (SocketCAN) | `slcan:PORT` | `udp:GROUP` | `log:FILE`.
Result<std::unique_ptr<CanBus>> open_can_bus(std::string_view spec, CanRole role);

}  // namespace narpa
