// python-can's `udp_multicast` bus over IPv4, pinned to loopback. It carries CAN FD and needs no kernel support,
// but loses frames when a reader is slow. Wire: protocols/can/udp_multicast.h.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "drivers/can/buses.h"
#include "drivers/datagram.h"
#include "drivers/descriptor.h"
#include "protocols/can/udp_multicast.h"

namespace narpa {
namespace {

class UdpMulticastBus final : public CanBus {
public:
    UdpMulticastBus(Descriptor in, Descriptor out, sockaddr_in group, sockaddr_in own, std::string text)
        : in_(std::move(in)), out_(std::move(out)), group_(group), own_(own), text_(std::move(text)) {}

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        // Bounded, so that a flood of junk cannot keep the caller here.
        for (int i = 0; i < kDatagramsPerCall; ++i) {
            std::array<std::uint8_t, 2 * kUdpMulticastMaxBytes> bytes;
            sockaddr_in source{};
            const Datagram d =
                receive_datagram(in_.get(), bytes, reinterpret_cast<sockaddr*>(&source), sizeof source);
            if (d.bytes < 0) return false;
            counters_.receive_overflow += losses_.increase_to(d.lost);
            // The group loops our own frames back.
            if (source.sin_port == own_.sin_port && source.sin_addr.s_addr == own_.sin_addr.s_addr) continue;
            const auto datagram = std::span<const std::uint8_t>(bytes).first(static_cast<std::size_t>(d.bytes));
            CanFrame frame;
            if (d.truncated || !decode_udp_multicast(datagram, frame)) {
                ++counters_.malformed;
            } else if (frame.error) {
                ++counters_.error_frames;
            } else {
                out = {frame, d.t_received_ns};
                ++counters_.received;
                return true;
            }
        }
        return false;
    }

    bool send(const CanFrame& frame) noexcept override {
        bool sent = false;
        if (sendable(frame)) {
            CanFrame padded = frame;
            if (frame.fd) {
                padded.size = fd_length(frame.size);
                std::fill(padded.data.begin() + frame.size, padded.data.end(), std::uint8_t{0});
            }
            std::array<std::uint8_t, kUdpMulticastMaxBytes> bytes;
            const std::size_t n = encode_udp_multicast(padded, bytes);
            sent = send_datagram(out_.get(), std::span(bytes).first(n), reinterpret_cast<const sockaddr*>(&group_),
                                 sizeof group_);
        }
        ++(sent ? counters_.sent : counters_.send_drops);
        return sent;
    }

    void wait(std::int64_t timeout_ns) noexcept override {
        std::array<pollfd, 2> fds{{{in_.get(), POLLIN, 0}, {wake_fd_, POLLIN, 0}}};
        wait_ready(fds, timeout_ns);
    }

    [[nodiscard]] bool carries_fd() const noexcept override { return true; }
    [[nodiscard]] std::string description() const override {
        return "udp_multicast: " + text_ + " port " + std::to_string(kUdpMulticastPort) + " on loopback";
    }

private:
    static constexpr int kDatagramsPerCall = 64;

    Descriptor in_, out_;
    sockaddr_in group_, own_;
    std::string text_;
    LossCount losses_;
};

sockaddr_in ipv4(in_addr address, std::uint16_t port) {
    sockaddr_in a{};
    a.sin_family = AF_INET;
    a.sin_addr = address;
    a.sin_port = htons(port);
    return a;
}

bool join(int fd, const sockaddr_in& group, in_addr loopback) {
    const int on = 1;
    ip_mreq membership{};
    membership.imr_multiaddr = group.sin_addr;
    membership.imr_interface = loopback;
    // Bound to the group's address, not to any: another group on the same port is another bus.
    return ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
           ::bind(fd, reinterpret_cast<const sockaddr*>(&group), sizeof group) == 0 &&
           ::setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) == 0;
}

/// A second socket for sending; its source port distinguishes our own frames.
bool prepare_sender(int fd, in_addr loopback, sockaddr_in& own) {
    const int ttl = 1;
    own = ipv4(loopback, 0);
    socklen_t bytes = sizeof own;
    return ::setsockopt(fd, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof loopback) == 0 &&
           ::setsockopt(fd, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl) == 0 &&
           ::bind(fd, reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0 &&
           ::getsockname(fd, reinterpret_cast<sockaddr*>(&own), &bytes) == 0;
}

}  // namespace

CanBusResult open_udp_multicast(const std::string& group, CanRole /*role*/) {
    in_addr address{};
    if (::inet_pton(AF_INET, group.c_str(), &address) != 1 || !IN_MULTICAST(ntohl(address.s_addr)))
        return Error{"udp:" + group + ": expected an IPv4 multicast address, such as udp:239.74.163.2"};
    in_addr loopback{};
    loopback.s_addr = htonl(INADDR_LOOPBACK);
    const sockaddr_in to = ipv4(address, kUdpMulticastPort);
    Descriptor in(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    Descriptor out(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    sockaddr_in own{};
    if (!in || !out || !join(in.get(), to, loopback) || !prepare_sender(out.get(), loopback, own))
        return Error{.what = "udp:" + group + ": cannot join the group on loopback: " + std::strerror(errno),
                     .kind = ErrorKind::missing,
                     .remedy = "sudo ip link set lo up"};
    prepare_for_bursts(in.get());
    return CanBusResult(std::make_unique<UdpMulticastBus>(std::move(in), std::move(out), to, own, group));
}

}  // namespace narpa
