// Frames from RTP packets, RFC 4175: of the sink rtp:, or of another sender of the scene's format.
#include <algorithm>
#include <array>
#include <vector>

#include "drivers/datagram.h"
#include "drivers/descriptor.h"
#include "drivers/udp_listener.h"
#include "drivers/video/backends.h"
#include "protocols/video/rtp_video.h"

namespace narpa {
namespace {

class RtpVideoSource final : public VideoSource {
public:
    RtpVideoSource(UdpListener listener, const VideoFormat& format, const RtpSampling& sampling)
        : fd_(std::move(listener.fd)),
          description_("RTP packets at " + listener.host + ", port " + listener.port),
          frames_text_(std::to_string(format.width) + " x " + std::to_string(format.height) + " " +
                       std::string(sampling.name) + " of " + std::to_string(sampling.depth) + " bits"),
          frames_(format, sampling),
          packet_(kPacketMost) {}

    [[nodiscard]] bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) override {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        while (status_) {
            const Datagram d = receive_datagram(fd_.get(), packet_);
            if (d.bytes < 0) {
                const std::int64_t left_ns = until_ns - monotonic_ns();
                if (left_ns <= 0) return false;
                std::array<pollfd, 1> fds{{{fd_.get(), POLLIN, 0}}};
                wait_ready(fds, left_ns);
                continue;
            }
            const RtpVideoAssembly::Frame* whole =
                frames_.take(std::span(packet_).first(static_cast<std::size_t>(d.bytes)));
            const RtpVideoAssembly::Counters& c = frames_.counters();
            counters_ = {.received = c.whole, .truncated = c.incomplete, .lost = c.missing};
            if (c.unfit > 0 && c.whole == 0)
                status_ = Error{"RTP packets came that are not of " + frames_text_ + ", as the scene has them"};
            if (whole == nullptr) continue;
            std::ranges::copy(whole->bytes, frame.begin());
            return true;
        }
        return false;
    }
    [[nodiscard]] std::string description() const override { return description_; }

private:
    static constexpr std::size_t kPacketMost = 65536;

    Descriptor fd_;
    std::string description_, frames_text_;
    RtpVideoAssembly frames_;
    std::vector<std::uint8_t> packet_;
};

}  // namespace

VideoSourceResult open_rtp_source(const std::string& text, const VideoFormat& format) {
    const std::string what = "video source \"rtp:" + text + "\"";
    const auto sampling = rtp_sampling(format);
    if (!sampling) return Error{what + ": " + sampling.error().what};
    // The options of a sink, so that one text names both ends of a rehearsal.
    auto listener = listen_udp(text.substr(0, text.find(',')), what, "rtp");
    if (!listener) return listener.error();
    return std::unique_ptr<VideoSource>(std::make_unique<RtpVideoSource>(*std::move(listener), format, *sampling));
}

}  // namespace narpa
