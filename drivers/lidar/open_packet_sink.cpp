#include <array>
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

PacketSinkResult open_null_packet_sink(const std::string&, const PacketSinkOptions&) {
    return std::unique_ptr<PacketSink>(new NullPacketSink);
}
PacketSinkResult refuse_bus(const std::string& text, const PacketSinkOptions&) {
    return Error{"packet sink \"" + text + "\": only `narpa run` puts shots on a CAN bus"};
}

bool is_pcap(const std::string& text) {
    return text.ends_with(".pcap");
}
bool is_can(const std::string& text) {
    return text == "can";
}

struct PacketSinkKind : DeviceKind {
    PacketSinkResult (*open)(const std::string& rest, const PacketSinkOptions& o);
};
constexpr std::array kPacketSinks{
    PacketSinkKind{{"udp:", "udp:HOST:PORT", "udp:HOST[%INTERFACE]:PORT[,ttl=N]", {}, {}, Destination::port},
                   open_udp_sink},
    PacketSinkKind{{"", "FILE.pcap", "FILE.pcap", is_pcap, {}, Destination::new_file}, open_pcap_sink},
    PacketSinkKind{{"ouster:", "ouster:PORT", "ouster:[ADDRESS:]PORT (an Ouster sensor's HTTP server)"},
                   open_ouster_sink},
    PacketSinkKind{{"", "can", "can (each shot on the CAN bus)", is_can, {}, Destination::bus}, refuse_bus},
    PacketSinkKind{{"", "none", "none", is_none}, open_null_packet_sink},
};
constexpr std::span<const PacketSinkKind> kPacketSinkTable{kPacketSinks};

}  // namespace

const DeviceKind* packet_sink_kind(const std::string& spec) {
    return find_kind(kPacketSinkTable, spec);
}
std::string packet_sink_help() {
    return help_of(kPacketSinkTable);
}

PacketSinkResult open_packet_sink(std::string_view spec, const LidarNetwork& network, bool wait_when_full,
                                  std::string_view metadata) {
    const std::string text(spec), name = "packet sink \"" + text + "\": ";
    const PacketSinkKind* kind = find_kind(kPacketSinkTable, text);
    if (kind == nullptr) return Error{name + "expected " + forms_of(kPacketSinkTable)};
    try {
        return kind->open(kind->rest_of(text), {network, wait_when_full, metadata});
    } catch (const std::exception& e) {  // no memory, no thread, no descriptor left
        return Error{name + e.what(), {}, 0, 0, ErrorKind::missing};
    }
}

}  // namespace narpa
