/// drivers/lidar/packet_capture.h - reads the UDP datagrams of a capture file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/result.h"

namespace narpa {

/// Header sizes of a captured frame: Ethernet II, IPv4 without options, UDP.
inline constexpr std::size_t kEthernetBytes = 14, kIpBytes = 20, kUdpBytes = 8;

/// The payloads of this size of all UDP datagrams over IPv4 and Ethernet, in the file's order; other traffic is
/// skipped. Errors: not a capture, another link than Ethernet, a file cut short, none of that size.
Result<std::vector<std::vector<std::uint8_t>>> read_datagrams(const std::string& path, std::size_t payload_bytes);

}  // namespace narpa
