/// drivers/lidar/packet_source.h - where LiDAR packets come from: a UDP port.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

struct PacketSourceCounters {
    std::uint64_t received = 0;
    std::uint64_t refused = 0;  ///< empty, or longer than the room that was given for it
    std::uint64_t lost = 0;     ///< the kernel threw them away: nobody took them in time
};

class PacketSource {
public:
    virtual ~PacketSource() = default;
    /// Waits for the next packet, at most `timeout_ns` (0: takes what is there), and writes it into `bytes`. The
    /// number of its bytes; 0: nothing in time.
    [[nodiscard]] virtual std::size_t receive(std::span<std::uint8_t> bytes, std::int64_t timeout_ns) noexcept = 0;
    [[nodiscard]] const PacketSourceCounters& counters() const noexcept { return counters_; }
    [[nodiscard]] virtual std::string description() const = 0;

protected:
    PacketSourceCounters counters_{};
};

/// The longest UDP datagram over IPv4: a buffer of this size takes any LiDAR's packets.
inline constexpr std::size_t kDatagramBytesMax = 65507;

/// SOURCE: `udp:PORT` (of any of this machine's addresses) | `udp:ADDRESS:PORT` (of this one; an IPv6 address
/// stands in brackets).
Result<std::unique_ptr<PacketSource>> open_packet_source(std::string_view spec);

}  // namespace narpa
