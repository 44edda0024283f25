/// protocols/can/udp_multicast.h - python-can's `udp_multicast` datagrams <-> CAN frames. No sockets.
///
/// One datagram is one msgpack map with the eleven keys of python-can 4's Message, in its order. python-can raises
/// in every receiver on a key it does not know, so none is ever added. Source: python-can 4.1,
/// can/interfaces/udp_multicast; msgpack specification.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocols/can/frame.h"

namespace narpa {

inline constexpr std::uint16_t kUdpMulticastPort = 43113;
inline constexpr std::size_t kUdpMulticastMaxBytes = 256;

/// Returns the number of bytes written.
[[nodiscard]] std::size_t encode_udp_multicast(const CanFrame& frame,
                                               std::span<std::uint8_t, kUdpMulticastMaxBytes> out) noexcept;

/// False when the datagram is not such a map or holds no valid frame; `out` is then unchanged. A missing
/// `is_extended_id` means true, as in python-can.
[[nodiscard]] bool decode_udp_multicast(std::span<const std::uint8_t> datagram, CanFrame& out) noexcept;

}  // namespace narpa
