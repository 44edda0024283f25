/// drivers/lidar/backends.h - the packet sinks behind the rows of the table in open_packet_sink.cpp. They get the
/// text after the prefix.
#pragma once

#include <memory>
#include <string>

#include "drivers/lidar/packet_sink.h"

namespace narpa {

using PacketSinkResult = Result<std::unique_ptr<PacketSink>>;

/// As for open_packet_sink.
struct PacketSinkOptions {
    const LidarNetwork& network;
    bool wait_when_full;
    std::string_view metadata;
};

/// `address`: udp_route.h.
PacketSinkResult open_udp_sink(const std::string& address, const PacketSinkOptions& o);
/// The Error of programs without libpcap.
[[nodiscard]] Error built_without_captures(const std::string& path);
/// Writes the metadata, if there is any, to FILE.json beside the capture.
PacketSinkResult open_pcap_sink(const std::string& path, const PacketSinkOptions& o);
/// `address`: PORT or ADDRESS:PORT to listen at.
PacketSinkResult open_ouster_sink(const std::string& address, const PacketSinkOptions& o);

}  // namespace narpa
