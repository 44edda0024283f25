#include <atomic>
#include <exception>

#include "drivers/lidar/backends.h"

namespace narpa {
namespace {

class NullPacketSink final : public PacketSink {
public:
    bool send(PacketKind, std::span<const std::uint8_t>, std::int64_t) noexcept override { return ++sent_ > 0; }
    void flush() noexcept override {}
    PacketCounters counters() const noexcept override { return {sent_, 0}; }
    std::string description() const override { return "none (packets are counted and thrown away)"; }

private:
    std::atomic<std::uint64_t> sent_{0};
};

}  // namespace

Result<std::unique_ptr<PacketSink>> open_packet_sink(std::string_view spec, const LidarNetwork& network,
                                                     std::int64_t epoch_unix_ns, bool wait_when_full) {
    constexpr std::string_view udp = "udp:";
    const std::string text(spec);
    try {
        if (text == "none") return std::unique_ptr<PacketSink>(new NullPacketSink);
        if (text.starts_with(udp)) return open_udp_sink(text.substr(udp.size()), network);
        if (text.ends_with(".pcap")) return open_pcap_sink(text, network, epoch_unix_ns, wait_when_full);
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{"packet sink \"" + text + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
    return Error{"packet sink \"" + text + "\": expected udp:HOST:PORT, FILE.pcap, or none"};
}

}  // namespace narpa
