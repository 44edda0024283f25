/// drivers/lidar/backends.h - the packet sinks behind open_packet_sink.
#pragma once

#include <memory>
#include <string>

#include "drivers/lidar/packet_sink.h"

namespace narpa {

/// UDP ports of the instrument; position packets keep their distance from the data port.
inline constexpr int kVelodyneDataPort = 2368, kVelodynePositionPort = 8308;
inline constexpr int kPositionPortOffset = kVelodynePositionPort - kVelodyneDataPort;

/// `address` is HOST:PORT; an IPv6 host stands in brackets.
Result<std::unique_ptr<PacketSink>> open_udp_sink(const std::string& address);
Result<std::unique_ptr<PacketSink>> open_pcap_sink(const std::string& path, std::int64_t epoch_unix_ns,
                                                   bool wait_when_full);
Result<std::unique_ptr<PacketSink>> open_null_packet_sink();

}  // namespace narpa
