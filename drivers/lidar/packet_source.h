/// drivers/lidar/packet_source.h - sources of LiDAR packets: UDP ports. capture.h reads files.
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
    std::uint64_t refused = 0;  ///< empty, or longer than the buffer
    std::uint64_t lost = 0;     ///< dropped by the kernel: the receive buffer was full
};

class PacketSource {
public:
    virtual ~PacketSource() = default;
    /// Waits for the next packet, at most `timeout_ns` (0: does not wait), and writes it into `bytes`. Returns its
    /// size; 0: timeout.
    [[nodiscard]] virtual std::size_t receive(std::span<std::uint8_t> bytes, std::int64_t timeout_ns) noexcept = 0;
    [[nodiscard]] const PacketSourceCounters& counters() const noexcept { return counters_; }
    [[nodiscard]] virtual std::string description() const = 0;

protected:
    PacketSourceCounters counters_{};
};

/// The longest UDP datagram over IPv4: a buffer of this size takes any LiDAR's packets.
inline constexpr std::size_t kDatagramBytesMax = 65507;

/// SOURCE: `udp:PORT` (on all of this machine's addresses) | `udp:ADDRESS[%INTERFACE]:PORT` (an IPv6 address is in
/// brackets); a multicast address is joined.
Result<std::unique_ptr<PacketSource>> open_packet_source(std::string_view spec);

}  // namespace narpa
