/// drivers/lidar/backends.h - the packet sinks behind open_packet_sink.
#pragma once

#include <memory>
#include <string>

#include "drivers/lidar/packet_sink.h"

namespace narpa {

/// `address`: udp_route.h.
Result<std::unique_ptr<PacketSink>> open_udp_sink(const std::string& address, const LidarNetwork& network);
Result<std::unique_ptr<PacketSink>> open_pcap_sink(const std::string& path, const LidarNetwork& network,
                                                   std::int64_t epoch_unix_ns, bool wait_when_full);
/// `address` is PORT or ADDRESS:PORT to listen at.
Result<std::unique_ptr<PacketSink>> open_ouster_sink(const std::string& address, std::string_view metadata);

}  // namespace narpa
