#include <exception>

#include "drivers/lidar/backends.h"

namespace narpa {

Result<std::unique_ptr<PacketSink>> open_packet_sink(std::string_view spec, const LidarNetwork& network,
                                                     std::int64_t epoch_unix_ns, bool wait_when_full) {
    constexpr std::string_view udp = "udp:";
    const std::string text(spec);
    try {
        if (text == "none") return open_null_packet_sink();
        if (text.starts_with(udp)) return open_udp_sink(text.substr(udp.size()), network);
        if (text.ends_with(".pcap")) return open_pcap_sink(text, network, epoch_unix_ns, wait_when_full);
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{"packet sink \"" + text + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
    return Error{"packet sink \"" + text + "\": expected udp:HOST:PORT, FILE.pcap, or none"};
}

}  // namespace narpa
