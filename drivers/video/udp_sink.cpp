// Frames in UDP datagrams that say where their bytes belong.
#include <limits>

#include "drivers/video/paced_datagrams.h"
#include "protocols/video/frame_datagram.h"

namespace narpa {
namespace {

class FrameDatagrams final : public FramePacketizer {
public:
    FrameDatagrams(const VideoFormat& format, std::size_t datagram_bytes)
        : format_(format), cut_(cut_into_frame_datagrams(format, datagram_bytes)) {}

    [[nodiscard]] std::uint32_t count() const noexcept override { return cut_.count(); }
    [[nodiscard]] std::size_t payload_bytes() const noexcept override {
        return link_bytes(format_) + count() * kFrameDatagramHeaderBytes;
    }
    [[nodiscard]] Payload payload(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                                  std::uint32_t index) noexcept override {
        const FrameCut::Part part = cut_[index];
        const auto bytes = frame.subspan(part.begin, part.bytes);
        header_ = encode_frame_datagram({.t_ns = stamp.t_ns,
                                         .frame = stamp.number,
                                         .pixel = format_.pixel,
                                         .link = format_.link,
                                         .width = static_cast<std::uint16_t>(format_.width),
                                         .height = static_cast<std::uint16_t>(format_.height),
                                         .index = index,
                                         .count = cut_.count(),
                                         .row = part.row,
                                         .byte_in_row = part.byte_in_row},
                                        bytes);
        return {header_, bytes};
    }

private:
    VideoFormat format_;
    FrameCut cut_;
    std::array<std::uint8_t, kFrameDatagramHeaderBytes> header_{};
};

}  // namespace

VideoSinkResult open_udp_video_sink(const std::string& text, const VideoSinkOptions& o) {
    auto target = DatagramTarget::open("udp", text);
    if (!target) return target.error();
    if (std::max(o.format.width, o.format.height) > std::numeric_limits<std::uint16_t>::max())
        return Error{target->what + ": expected at most 65535 x 65535 pixels"};
    auto datagrams =
        std::make_unique<FrameDatagrams>(o.format, static_cast<std::size_t>(target->mtu) - kIpUdpBytes);
    return paced_sink(*std::move(target), std::move(datagrams), o.format, o.full, "UDP datagrams");
}

}  // namespace narpa
