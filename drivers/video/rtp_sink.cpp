// Frames in RTP packets, RFC 4175, and the SDP file that tells receivers of them.
#include <cerrno>
#include <cstring>
#include <fstream>

#include "drivers/video/paced_datagrams.h"
#include "protocols/crc32.h"
#include "protocols/video/rtp_video.h"

namespace narpa {
namespace {

class RtpPacketizer final : public FramePacketizer {
public:
    explicit RtpPacketizer(RtpVideoPackets packets) : packets_(std::move(packets)) {}

    [[nodiscard]] std::uint32_t count() const noexcept override { return packets_.count(); }
    [[nodiscard]] std::size_t payload_bytes() const noexcept override { return packets_.frame_packets_bytes(); }
    [[nodiscard]] Payload payload(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                                  std::uint32_t index) noexcept override {
        return {packets_.next(frame, stamp.t_ns, stamp.number, index), {}};
    }

private:
    RtpVideoPackets packets_;
};

RtpSession session_of(const DatagramTarget& target) {
    UdpDestination own;
    own.size = sizeof own.address;
    ::getsockname(target.fd.get(), reinterpret_cast<sockaddr*>(&own.address), &own.size);
    const UdpDestination& to = target.destination;
    return {.sender = own.text(),
            .receiver = to.text(),
            .ipv6 = to.address.ss_family == AF_INET6,
            .multicast_ttl = !to.is_multicast()       ? -1
                             : target.address.ttl < 0 ? 1
                                                      : target.address.ttl,
            .port = static_cast<std::uint16_t>(std::stoi(target.address.port))};
}

Status write_sdp(const std::string& file, const std::string& text, const std::string& what) {
    errno = 0;
    std::ofstream out(file, std::ios::binary);
    out << text;
    if (out.flush()) return Ok{};
    return Error{what + ": cannot write the SDP file \"" + file + "\": " + std::strerror(errno),
                 {},
                 0,
                 0,
                 ErrorKind::missing};
}

}  // namespace

VideoSinkResult open_rtp_sink(const std::string& text, const VideoSinkOptions& o) {
    std::string sdp_file;
    auto target = DatagramTarget::open("rtp", text, {{"sdp", 0, 0, nullptr, &sdp_file}});
    if (!target) return target.error();
    const auto sampling = rtp_sampling(o.format);
    if (!sampling) return Error{target->what + ": " + sampling.error().what};
    // The same in each run: nothing else sends in this session.
    const std::string name = target->destination.text() + ":" + target->address.port;
    const std::uint32_t ssrc = crc32({reinterpret_cast<const std::uint8_t*>(name.data()), name.size()});
    const auto packet_bytes = static_cast<std::size_t>(target->mtu) - kIpUdpBytes;
    auto packets = std::make_unique<RtpPacketizer>(RtpVideoPackets(o.format, *sampling, packet_bytes, ssrc));
    const std::string sdp = rtp_video_sdp(o.format, *sampling, session_of(*target)), what = target->what;

    VideoFormat samples = o.format;  // packed as RFC 4175 says, from the samples
    samples.link = {};
    auto sink = paced_sink(
        *std::move(target), std::move(packets), samples, o.full,
        "RTP packets (" + std::string(sampling->name) + " of " + std::to_string(sampling->depth) + " bits)",
        sdp_file.empty() ? "" : "; ffplay -protocol_whitelist file,udp,rtp " + sdp_file);
    if (!sink || sdp_file.empty()) return sink;
    if (auto written = write_sdp(sdp_file, sdp, what); !written) return written.error();
    return sink;
}

}  // namespace narpa
