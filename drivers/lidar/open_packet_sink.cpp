#include <atomic>
#include <exception>
#include <utility>

#include "base/write_file.h"
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
                                                     std::int64_t epoch_unix_ns, bool wait_when_full,
                                                     std::string_view metadata) {
    constexpr std::string_view udp = "udp:", ouster = "ouster:";
    const std::string text(spec);
    try {
        if (text == "none") return std::unique_ptr<PacketSink>(new NullPacketSink);
        if (text.starts_with(udp)) return open_udp_sink(text.substr(udp.size()), network);
        if (text.starts_with(ouster)) return open_ouster_sink(text.substr(ouster.size()), metadata);
        if (text.ends_with(".pcap")) {
            auto sink = open_pcap_sink(text, network, epoch_unix_ns, wait_when_full);
            if (!sink || metadata.empty()) return sink;
            const Status written = write_file(document_beside(text), metadata);
            return written ? std::move(sink) : Result<std::unique_ptr<PacketSink>>(written.error());
        }
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{"packet sink \"" + text + "\": " + e.what(), {}, 0, 0, ErrorKind::missing};
    }
    return Error{"packet sink \"" + text + "\": expected udp:HOST:PORT, FILE.pcap, ouster:PORT, or none"};
}

}  // namespace narpa
