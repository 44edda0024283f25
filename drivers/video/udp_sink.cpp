// Frames in UDP datagrams, at a steady rate: a burst of a whole frame would overflow the buffers of receivers.
#include <netinet/in.h>
#include <sys/uio.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/text/read_number.h"
#include "drivers/descriptor.h"
#include "drivers/udp_route.h"
#include "drivers/video/backends.h"
#include "protocols/video/frame_datagram.h"

namespace narpa {
namespace {

constexpr int kMtu = 1500, kMinMtu = 128, kMaxMtu = 65535;
constexpr int kMbitPerSecond = 1000, kMaxMbitPerSecond = 100'000;
/// Ethernet's part of a datagram on the wire: preamble, header, checksum, gap.
constexpr std::size_t kEthernetOverheadBytes = 8 + 14 + 4 + 12;
/// What goes without a wait, because shorter waits are longer than asked for.
constexpr std::int64_t kBurst_ns = 100'000;

class UdpVideoWriter final : public VideoWriter {
public:
    UdpVideoWriter(Descriptor fd, const VideoFormat& format, int mtu, int mbit_s)
        : fd_(std::move(fd)),
          format_(format),
          cut_(format, static_cast<std::size_t>(mtu) - kIpUdpBytes),
          ns_per_byte_(8e3 / mbit_s) {}

    [[nodiscard]] double ns_of_a_frame() const noexcept {
        const double headers =
            static_cast<double>(cut_.count() * (kFrameDatagramHeaderBytes + kIpUdpBytes + kEthernetOverheadBytes));
        return ns_per_byte_ * (static_cast<double>(link_bytes(format_)) + headers);
    }

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                     const WriteQueue& queue) noexcept override {
        FrameDatagramHeader header{.t_ns = stamp.t_ns,
                                   .frame = stamp.number,
                                   .pixel = format_.pixel,
                                   .link = format_.link,
                                   .width = static_cast<std::uint16_t>(format_.width),
                                   .height = static_cast<std::uint16_t>(format_.height),
                                   .count = cut_.count()};
        std::int64_t due_ns = monotonic_ns();
        for (; header.index < header.count; ++header.index) {
            if (header.index > 0 && queue.time_left_ms() == 0) {
                ++failed;
                return;
            }
            const FrameCut::Part part = cut_[header.index];
            header.row = part.row, header.byte_in_row = part.byte_in_row;
            if (!send(header, frame.subspan(part.begin, part.bytes))) return;
            due_ns += std::llround(ns_per_byte_ * static_cast<double>(part.bytes + kFrameDatagramHeaderBytes +
                                                                      kIpUdpBytes + kEthernetOverheadBytes));
            const std::int64_t early_ns = due_ns - monotonic_ns();
            if (early_ns > kBurst_ns) wait_ready({}, early_ns);
            if (early_ns < -kBurst_ns) due_ns -= early_ns + kBurst_ns;  // what a stall has cost is not made up for
        }
        ++written;
    }

private:
    /// Counts why a datagram was not sent.
    bool send(const FrameDatagramHeader& header, std::span<const std::uint8_t> bytes) noexcept {
        const auto head = encode_frame_datagram(header, bytes);
        std::array<iovec, 2> pieces{{{const_cast<std::uint8_t*>(head.data()), head.size()},
                                     {const_cast<std::uint8_t*>(bytes.data()), bytes.size()}}};
        msghdr message{};
        message.msg_iov = pieces.data();
        message.msg_iovlen = pieces.size();
        ssize_t n = 0;
        do {
            n = ::sendmsg(fd_.get(), &message, MSG_NOSIGNAL);
        } while (n < 0 && errno == EINTR);
        if (n >= 0) return true;
        ++(errno == ECONNREFUSED ? no_reader : failed);
        return false;
    }

    Descriptor fd_;
    VideoFormat format_;
    FrameCut cut_;
    double ns_per_byte_;
};

}  // namespace

VideoSinkResult open_udp_video_sink(const std::string& text, const VideoSinkOptions& o) {
    int mtu = kMtu, mbit_s = kMbitPerSecond;
    const auto address =
        UdpAddress::parse(text, {{"mtu", kMinMtu, kMaxMtu, &mtu}, {"mbit_s", 1, kMaxMbitPerSecond, &mbit_s}});
    if (!address) return address.error();
    const std::string what = "udp:" + text;
    std::uint16_t port = 0;
    if (address->host.empty() || !read_number(address->port, port) || port == 0)
        return Error{what + ": expected udp:HOST:PORT, as in udp:192.168.1.70:5004"};
    if (std::max(o.format.width, o.format.height) > std::numeric_limits<std::uint16_t>::max())
        return Error{what + ": expected at most 65535 x 65535 pixels"};
    Result<UdpDestination> destination = UdpDestination::resolve(address->host, what);
    if (!destination) return destination.error();
    Descriptor fd(::socket(destination->address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (!fd) return Error{what + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    if (auto set = set_route(fd.get(), *destination, *address, what); !set) return set.error();
    destination->set_port(port);
    // Connected, so that a machine where nobody receives says so.
    if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&destination->address), destination->size) != 0)
        return Error{what + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    auto writer = std::make_unique<UdpVideoWriter>(std::move(fd), o.format, mtu, mbit_s);
    const auto period_ns = static_cast<double>(o.format.period_ns);
    if (writer->ns_of_a_frame() > period_ns) {
        const auto needed = static_cast<int>(std::ceil(mbit_s * writer->ns_of_a_frame() / period_ns));
        return Error{what + ": the frames need " + std::to_string(needed) + " Mbit/s, but " +
                     std::to_string(mbit_s) + " are given: expected ,mbit_s=" + std::to_string(needed) +
                     " or more, smaller frames or fewer"};
    }
    return queued_sink(std::move(writer), o.format, o.full,
                       "UDP datagrams of at most " + std::to_string(mtu) + " bytes to " + address->host +
                           ", port " + address->port + ", at " + std::to_string(mbit_s) + " Mbit/s");
}

}  // namespace narpa
