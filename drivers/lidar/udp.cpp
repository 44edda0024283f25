#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>

#include "drivers/lidar/backends.h"

namespace narpa {
namespace {

struct Destination {
    sockaddr_storage address{};
    socklen_t size = 0;

    void set_port(int port) {
        const in_port_t wire = htons(static_cast<std::uint16_t>(port));
        if (address.ss_family == AF_INET6) {
            reinterpret_cast<sockaddr_in6&>(address).sin6_port = wire;
        } else {
            reinterpret_cast<sockaddr_in&>(address).sin_port = wire;
        }
    }
};

class UdpSink final : public PacketSink {
public:
    /// `position_port_offset`: 0 where there are no position packets.
    UdpSink(int fd, const Destination& data, int port, int position_port_offset, const std::string& host)
        : fd_(fd),
          destinations_{data, data},
          description_("UDP to " + host + ", data port " + std::to_string(port)) {
        destinations_[0].set_port(port);
        destinations_[1].set_port(port + position_port_offset);
        if (position_port_offset != 0)
            description_ += ", position port " + std::to_string(port + position_port_offset);
    }
    ~UdpSink() override { ::close(fd_); }
    UdpSink(const UdpSink&) = delete;
    UdpSink& operator=(const UdpSink&) = delete;

    bool send(PacketKind kind, std::span<const std::uint8_t> payload, std::int64_t) noexcept override {
        const Destination& to = destinations_[kind == PacketKind::data ? 0 : 1];
        ssize_t n = 0;
        do
            n = ::sendto(fd_, payload.data(), payload.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                         reinterpret_cast<const sockaddr*>(&to.address), to.size);
        while (n < 0 && errno == EINTR);
        const bool sent = n == static_cast<ssize_t>(payload.size());
        (sent ? sent_ : dropped_).fetch_add(1, std::memory_order_relaxed);
        return sent;
    }
    void flush() noexcept override {}
    PacketCounters counters() const noexcept override {
        return {sent_.load(std::memory_order_relaxed), dropped_.load(std::memory_order_relaxed)};
    }
    std::string description() const override { return description_; }

private:
    int fd_;
    std::array<Destination, 2> destinations_;
    std::string description_;
    std::atomic<std::uint64_t> sent_{0}, dropped_{0};
};

Result<int> port_from(std::string_view text, const std::string& address, int position_port_offset) {
    int port = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
    const int least = std::max(1, 1 - position_port_offset), most = std::min(65535, 65535 - position_port_offset);
    if (error == std::errc{} && end == text.data() + text.size() && port >= least && port <= most) return port;
    std::string what =
        "udp:" + address + ": expected a data port from " + std::to_string(least) + " to " + std::to_string(most);
    if (position_port_offset != 0)
        what += " (position packets go to the port " + std::to_string(std::abs(position_port_offset)) +
                (position_port_offset > 0 ? " above it)" : " below it)");
    return Error{what};
}

Result<Destination> resolve(const std::string& host, const std::string& address) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    if (const int error = ::getaddrinfo(host.c_str(), nullptr, &hints, &found); error != 0)
        return Error{"udp:" + address + ": unknown host \"" + host + "\": " + ::gai_strerror(error)};
    Destination destination;
    std::memcpy(&destination.address, found->ai_addr, found->ai_addrlen);
    destination.size = found->ai_addrlen;
    ::freeaddrinfo(found);
    return destination;
}

}  // namespace

Result<std::unique_ptr<PacketSink>> open_udp_sink(const std::string& address, const LidarNetwork& network) {
    const std::size_t colon = address.rfind(':');
    std::string host = address.substr(0, colon);
    if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
    if (colon == address.npos || host.empty())
        return Error{"udp:" + address + ": expected udp:HOST:PORT, as in udp:127.0.0.1:2368"};
    const Result<int> port =
        port_from(std::string_view(address).substr(colon + 1), address, network.position_port_offset());
    if (!port) return port.error();
    const Result<Destination> destination = resolve(host, address);
    if (!destination) return destination.error();

    // Not connected: on a connected socket an ICMP "port unreachable" makes the next send fail.
    const int fd = ::socket(destination->address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (fd < 0) return Error{"udp:" + address + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    const int on = 1;  // as the instrument does
    ::setsockopt(fd, SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
    return std::unique_ptr<PacketSink>(
        std::make_unique<UdpSink>(fd, *destination, *port, network.position_port_offset(), host));
}

}  // namespace narpa
