/// drivers/can/can_bus.h - the interface of every CAN bus: SocketCAN, slcan, UDP multicast, USB adapters, memory,
/// logs.
///
/// Nothing here blocks, allocates or throws after `open_can_bus`. Frames that cannot be sent or stored are dropped
/// and counted. A bus that goes away (interface down, client gone) is reopened when it is back.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "drivers/device_kind.h"
#include "protocols/can/frame.h"

namespace narpa {

class ClientHub;  // client_hub.h

/// Since the bus was opened.
struct CanCounters {
    std::uint64_t received = 0;
    std::uint64_t sent = 0;
    std::uint64_t send_drops = 0;        ///< queue full, no client, interface down, FD on a classic bus
    std::uint64_t receive_overflow = 0;  ///< frames that the kernel or a full buffer dropped before they were read
    std::uint64_t malformed = 0;         ///< lines or datagrams that are not a CAN frame
    std::uint64_t not_carried = 0;       ///< frames of kinds that the bus does not carry: CAN XL
    std::uint64_t error_frames = 0;      ///< controller error reports
    std::uint64_t bus_off = 0;           ///< times that the controller went bus-off
    std::uint64_t interface_down = 0;    ///< times that the interface or the connection went away
};

/// A frame and its time of arrival (CLOCK_MONOTONIC). For a log: the time since its first line.
struct ReceivedFrame {
    CanFrame frame{};
    std::int64_t t_received_ns = 0;
};

/// Addresses through which clients reach a bus, for other programs.
struct CanAddress {
    std::string bus;  ///< BUS of open_can_bus; empty: the one with which this side opened it
    std::string pty;  ///< pseudo-terminal; empty: none
};

/// How two buses stand for one (redundant_bus.h).
struct BusRedundancy {
    /// Hot: both carry everything, and of two equal frames the first one counts. Cold: one bus is in use, A first;
    /// the other one takes over when the master is heard there after it has been silent on the bus in use.
    bool is_cold = false;
    std::uint32_t heartbeat_id = 0;  ///< cold: of the master, 11 bits; 0: any frame is its sign of life
    std::int64_t heartbeat_timeout_ns = 500'000'000;  ///< cold: the silence after which another bus is taken
};

/// What one of two buses has carried.
struct BusUse {
    std::string bus;               ///< CanBus::description
    std::uint64_t used = 0;        ///< frames that were taken from it
    std::uint64_t duplicates = 0;  ///< hot: frames that the other bus had brought before
    std::uint64_t idle = 0;        ///< cold: frames that came while the other bus was in use
    CanCounters counters{};
};

class CanBus {
public:
    virtual ~CanBus() = default;

    /// Reads the next frame in the receive queue; false when it is empty. Error frames are counted, not returned.
    [[nodiscard]] virtual bool receive(ReceivedFrame& out) noexcept = 0;
    /// False: dropped and counted.
    virtual bool send(const CanFrame& frame) noexcept = 0;
    /// Waits until `receive` may have a frame or the timeout; -1: no timeout. May wake early.
    virtual void wait(std::int64_t timeout_ns) noexcept = 0;
    /// `wait` of a bus that is no log also ends while this descriptor has something to read; -1: none.
    void wake_by(int fd) noexcept { wake_fd_ = fd; }
    /// No frame will arrive any more (the end of a log).
    [[nodiscard]] virtual bool ended() const noexcept { return false; }
    /// The frames are a recording: all can be read at once, and each is due at its `t_received_ns`.
    [[nodiscard]] virtual bool recorded() const noexcept { return false; }
    [[nodiscard]] virtual bool carries_fd() const noexcept = 0;
    /// How a client connects to this bus, for messages: "slcan: 127.0.0.1:29537 and /dev/pts/3".
    [[nodiscard]] virtual std::string description() const = 0;
    [[nodiscard]] virtual CanAddress address() const { return {}; }
    /// The bus as a server of clients; null: it has none.
    [[nodiscard]] virtual ClientHub* clients() noexcept { return nullptr; }
    [[nodiscard]] const CanCounters& counters() const noexcept { return counters_; }

    // Of two buses that stand for one.

    /// Before the first frame.
    virtual void set_redundancy(const BusRedundancy& /*redundancy*/) noexcept {}
    /// What each of two has carried; empty: it is one.
    [[nodiscard]] virtual std::vector<BusUse> uses() const { return {}; }
    /// How often the other bus was taken into use.
    [[nodiscard]] virtual std::uint64_t switches() const noexcept { return 0; }

protected:
    CanCounters counters_{};
    int wake_fd_ = -1;
};

/// Frames that a reader takes before it does other work; on a flooded bus there is always another frame.
inline constexpr int kFramesPerTurn = 4096;

/// `hub` is the side of `narpa run`, `client` that of programs that command it (`narpa fly`). They differ where a
/// bus has a server (slcan) or a direction (log: a hub reads it, a client writes it).
enum class CanRole : std::uint8_t { hub, client };

/// BUS: a text of one of the kinds in can_bus.cpp.
Result<std::unique_ptr<CanBus>> open_can_bus(std::string_view spec, CanRole role);
/// The kind that a text names; null: none.
[[nodiscard]] const DeviceKind* can_bus_kind(const std::string& spec);
/// All kinds, for --help.
[[nodiscard]] std::string can_bus_help();

}  // namespace narpa
