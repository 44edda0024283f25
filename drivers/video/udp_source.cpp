// Frames from UDP datagrams: the receiver of the sink udp:.
#include <algorithm>
#include <array>
#include <vector>

#include "drivers/datagram.h"
#include "drivers/descriptor.h"
#include "drivers/udp_listener.h"
#include "drivers/video/backends.h"
#include "protocols/video/frame_datagram.h"

namespace narpa {
namespace {

class UdpVideoSource final : public VideoSource {
public:
    UdpVideoSource(UdpListener listener, const VideoFormat& format)
        : fd_(std::move(listener.fd)),
          description_("UDP datagrams at " + listener.host + ", port " + listener.port),
          frames_(format),
          datagram_(kMaxDatagram) {}

    [[nodiscard]] bool receive(std::span<std::uint8_t> frame, std::int64_t timeout_ns) override {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        while (status_) {
            const Datagram d = receive_datagram(fd_.get(), datagram_);
            if (d.bytes < 0) {
                const std::int64_t left_ns = until_ns - monotonic_ns();
                if (left_ns <= 0) return false;
                std::array<pollfd, 1> fds{{{fd_.get(), POLLIN, 0}}};
                wait_ready(fds, left_ns);
                continue;
            }
            const FrameAssembly::Frame* whole =
                frames_.take(std::span(datagram_).first(static_cast<std::size_t>(d.bytes)));
            const FrameAssembly::Counters& c = frames_.counters();
            counters_ = {.received = c.whole, .truncated = c.incomplete, .lost = c.missing};
            if (const auto& other = frames_.other_format(); other && c.whole == 0)
                status_ =
                    Error{"frames of " + std::to_string(other->width) + " x " + std::to_string(other->height) +
                          " " + link_text(other->pixel, other->link) + " came, expected those of the scene"};
            if (whole == nullptr) continue;
            std::ranges::copy(whole->bytes, frame.begin());
            return true;
        }
        return false;
    }
    [[nodiscard]] std::string description() const override { return description_; }

private:
    static constexpr std::size_t kMaxDatagram = 65536;

    Descriptor fd_;
    std::string description_;
    FrameAssembly frames_;
    std::vector<std::uint8_t> datagram_;
};

}  // namespace

VideoSourceResult open_udp_video_source(const std::string& text, const VideoFormat& format) {
    // The options of a sink, so that one text names both ends of a rehearsal.
    auto listener = listen_udp(text.substr(0, text.find(',')), "video source \"udp:" + text + "\"");
    if (!listener) return listener.error();
    return std::unique_ptr<VideoSource>(std::make_unique<UdpVideoSource>(*std::move(listener), format));
}

}  // namespace narpa
