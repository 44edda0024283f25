#include "drivers/lidar/packet_capture.h"

#ifdef NARPA_WITH_PCAP

#include <pcap/pcap.h>

#include <array>
#include <memory>

namespace narpa {
namespace {

constexpr std::uint8_t kUdpProtocol = 17;

std::size_t be16(const std::uint8_t* at) {
    return static_cast<std::size_t>(at[0] << 8 | at[1]);
}

/// Offset of the payload of a whole UDP datagram of this size; 0: the frame is not one.
std::size_t payload_at(const std::uint8_t* frame, std::size_t size, std::size_t payload_bytes) {
    constexpr std::size_t kIpv4 = 0x0800, kOffsetMask = 0x3FFF;  // more fragments, or not the first
    if (size < kEthernetBytes + kIpBytes + kUdpBytes || be16(frame + 12) != kIpv4) return 0;
    const std::uint8_t* ip = frame + kEthernetBytes;
    const std::size_t header = static_cast<std::size_t>(ip[0] & 0xF) * 4;
    if (ip[0] >> 4 != 4 || header < kIpBytes || ip[9] != kUdpProtocol || (be16(ip + 6) & kOffsetMask) != 0)
        return 0;
    const std::size_t at = kEthernetBytes + header + kUdpBytes;
    if (size < at + payload_bytes || be16(ip + header + 4) != kUdpBytes + payload_bytes) return 0;
    return at;
}

}  // namespace

Result<std::vector<std::vector<std::uint8_t>>> read_datagrams(const std::string& path, std::size_t payload_bytes) {
    std::array<char, PCAP_ERRBUF_SIZE> why{};
    const std::unique_ptr<pcap_t, void (*)(pcap_t*)> file(::pcap_open_offline(path.c_str(), why.data()),
                                                          ::pcap_close);
    if (!file) return Error{std::string(why.data()) + "; expected a capture (pcap)", path};
    if (::pcap_datalink(file.get()) != DLT_EN10MB) return Error{"not captured from Ethernet, expected that", path};
    std::vector<std::vector<std::uint8_t>> payloads;
    pcap_pkthdr* header = nullptr;
    const u_char* frame = nullptr;
    int read = 0;
    while ((read = ::pcap_next_ex(file.get(), &header, &frame)) == 1)
        if (const std::size_t at = payload_at(frame, header->caplen, payload_bytes); at > 0)
            payloads.emplace_back(frame + at, frame + at + payload_bytes);
    if (read == PCAP_ERROR) return Error{::pcap_geterr(file.get()), path};
    if (payloads.empty())
        return Error{"holds no UDP datagram of " + std::to_string(payload_bytes) + " bytes, expected a LiDAR's",
                     path};
    return payloads;
}

}  // namespace narpa

#else

namespace narpa {
Result<std::vector<std::vector<std::uint8_t>>> read_datagrams(const std::string& path, std::size_t) {
    return Error{"narpa was built without libpcap",
                 path,
                 0,
                 0,
                 ErrorKind::missing,
                 "apt install libpcap-dev, then configure with -DNARPA_WITH_PCAP=ON"};
}
}  // namespace narpa

#endif
