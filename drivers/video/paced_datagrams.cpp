#include "drivers/video/paced_datagrams.h"

#include <sys/uio.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "base/text/read_number.h"
#include "protocols/video/frame_cut.h"

namespace narpa {
namespace {

constexpr int kMinMtu = 128, kMaxMtu = 65535, kMaxMbitPerSecond = 100'000;
/// Ethernet's part of a datagram on the wire: preamble, header, checksum, gap.
constexpr std::size_t kEthernetOverheadBytes = 8 + 14 + 4 + 12;
/// What goes without a wait, because shorter waits are longer than asked for.
constexpr std::int64_t kBurst_ns = 100'000;

class PacedWriter final : public VideoWriter {
public:
    PacedWriter(Descriptor fd, std::unique_ptr<FramePacketizer> packetizer, int mbit_s)
        : fd_(std::move(fd)), packetizer_(std::move(packetizer)), ns_per_byte_(8e3 / mbit_s) {}

    [[nodiscard]] double ns_of_a_frame() const noexcept {
        const std::size_t headers = packetizer_->count() * (kIpUdpBytes + kEthernetOverheadBytes);
        return ns_per_byte_ * static_cast<double>(packetizer_->payload_bytes() + headers);
    }

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp& stamp,
                     const WriteQueue& queue) noexcept override {
        std::int64_t due_ns = monotonic_ns();
        for (std::uint32_t index = 0; index < packetizer_->count(); ++index) {
            if (index > 0 && queue.time_left_ms() == 0) {
                ++failed;
                return;
            }
            const FramePacketizer::Payload payload = packetizer_->payload(frame, stamp, index);
            if (!send(payload)) return;
            due_ns += std::llround(ns_per_byte_ * static_cast<double>(payload.header.size() + payload.bytes.size() +
                                                                      kIpUdpBytes + kEthernetOverheadBytes));
            const std::int64_t early_ns = due_ns - monotonic_ns();
            if (early_ns > kBurst_ns) wait_ready({}, early_ns);
            if (early_ns < -kBurst_ns) due_ns -= early_ns + kBurst_ns;  // what a stall has cost is not made up for
        }
        ++written;
    }

private:
    /// Counts why a datagram was not sent.
    bool send(const FramePacketizer::Payload& payload) noexcept {
        std::array<iovec, 2> pieces{{{const_cast<std::uint8_t*>(payload.header.data()), payload.header.size()},
                                     {const_cast<std::uint8_t*>(payload.bytes.data()), payload.bytes.size()}}};
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
    std::unique_ptr<FramePacketizer> packetizer_;
    double ns_per_byte_;
};

}  // namespace

Result<DatagramTarget> DatagramTarget::open(std::string_view scheme, const std::string& text,
                                            std::vector<UdpOption> options) {
    DatagramTarget t;
    t.what = std::string(scheme) + ":" + text;
    options.insert(options.begin(),
                   {{"mtu", kMinMtu, kMaxMtu, &t.mtu}, {"mbit_s", 1, kMaxMbitPerSecond, &t.mbit_s}});
    auto address = UdpAddress::parse(text, std::move(options), scheme);
    if (!address) return address.error();
    t.address = *std::move(address);
    std::uint16_t port = 0;
    if (t.address.host.empty() || !read_number(t.address.port, port) || port == 0)
        return Error{t.what + ": expected " + std::string(scheme) + ":HOST:PORT, as in " + std::string(scheme) +
                     ":192.168.1.70:5004"};
    auto destination = UdpDestination::resolve(t.address.host, t.what);
    if (!destination) return destination.error();
    t.destination = *destination;
    t.fd = Descriptor(::socket(t.destination.address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (!t.fd) return Error{t.what + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    if (auto set = set_route(t.fd.get(), t.destination, t.address, t.what); !set) return set.error();
    t.destination.set_port(port);
    if (::connect(t.fd.get(), reinterpret_cast<const sockaddr*>(&t.destination.address), t.destination.size) != 0)
        return Error{t.what + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    return t;
}

VideoSinkResult paced_sink(DatagramTarget target, std::unique_ptr<FramePacketizer> packetizer,
                           const VideoFormat& format, WhenFull full, const std::string& datagrams,
                           const std::string& remark) {
    const int mbit_s = target.mbit_s;
    auto writer = std::make_unique<PacedWriter>(std::move(target.fd), std::move(packetizer), mbit_s);
    const auto period_ns = static_cast<double>(format.period_ns);
    if (writer->ns_of_a_frame() > period_ns) {
        const auto needed = static_cast<int>(std::ceil(mbit_s * writer->ns_of_a_frame() / period_ns));
        return Error{target.what + ": the frames need " + std::to_string(needed) + " Mbit/s, but " +
                     std::to_string(mbit_s) + " are given: expected ,mbit_s=" + std::to_string(needed) +
                     " or more, smaller frames or fewer"};
    }
    return queued_sink(std::move(writer), format, full,
                       datagrams + " of at most " + std::to_string(target.mtu) + " bytes to " +
                           target.address.host + ", port " + target.address.port + ", at " +
                           std::to_string(mbit_s) + " Mbit/s" + remark);
}

}  // namespace narpa
