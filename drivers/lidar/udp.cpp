#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <utility>

#include "base/read_number.h"
#include "drivers/can/datagram.h"
#include "drivers/can/descriptor.h"
#include "drivers/lidar/backends.h"
#include "drivers/lidar/packet_source.h"
#include "drivers/lidar/receiver_watch.h"

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
    UdpSink(Descriptor fd, const Destination& data, int port, int position_port_offset, const std::string& host)
        : fd_(std::move(fd)),
          destinations_{data, data},
          receivers_(data.address, {port, position_port_offset == 0 ? 0 : port + position_port_offset}),
          description_("UDP to " + host + ", data port " + std::to_string(port)) {
        destinations_[0].set_port(port);
        destinations_[1].set_port(port + position_port_offset);
        if (position_port_offset != 0)
            description_ += ", position port " + std::to_string(port + position_port_offset);
    }

    bool send(PacketKind kind, std::span<const std::uint8_t> payload, std::int64_t) noexcept override {
        const Destination& to = destinations_[kind == PacketKind::data ? 0 : 1];
        ssize_t n = 0;
        do
            n = ::sendto(fd_.get(), payload.data(), payload.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                         reinterpret_cast<const sockaddr*>(&to.address), to.size);
        while (n < 0 && errno == EINTR);
        const bool sent = n == static_cast<ssize_t>(payload.size());
        ++(sent ? sent_ : dropped_);
        return sent;
    }
    void flush() noexcept override { receivers_.update(); }
    PacketCounters counters() const noexcept override { return {sent_, dropped_, receivers_.dropped()}; }
    std::string description() const override { return description_; }

private:
    Descriptor fd_;
    std::array<Destination, 2> destinations_;
    ReceiverWatch receivers_;
    std::string description_;
    std::atomic<std::uint64_t> sent_{0}, dropped_{0};
};

/// "HOST:PORT", "[HOST]:PORT" or "PORT".
std::pair<std::string, std::string> split_port(std::string_view text) {
    const std::size_t colon = text.rfind(':');
    if (colon == text.npos) return {"", std::string(text)};
    std::string_view host = text.substr(0, colon);
    if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
    return {std::string(host), std::string(text.substr(colon + 1))};
}

/// 1 to 65535, or nothing.
std::optional<int> udp_port(std::string_view text) {
    std::uint16_t port = 0;
    return read_number(text, port) && port > 0 ? std::optional<int>(port) : std::nullopt;
}

Result<int> data_port(std::string_view text, const std::string& address, int position_port_offset) {
    const int least = std::max(1, 1 - position_port_offset), most = std::min(65535, 65535 - position_port_offset);
    const std::optional<int> port = udp_port(text);
    if (port && *port >= least && *port <= most) return *port;
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

class UdpSource final : public PacketSource {
public:
    UdpSource(Descriptor fd, std::string description) : fd_(std::move(fd)), description_(std::move(description)) {}

    [[nodiscard]] std::size_t receive(std::span<std::uint8_t> bytes, std::int64_t timeout_ns) noexcept override {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        for (;;) {
            const Datagram d = receive_datagram(fd_.get(), bytes);
            if (d.bytes >= 0) {
                counters_.lost += losses_.increase_to(d.lost);
                const bool good = d.bytes > 0 && !d.truncated;
                ++(good ? counters_.received : counters_.refused);
                if (good) return static_cast<std::size_t>(d.bytes);
                continue;
            }
            const std::int64_t left_ns = until_ns - monotonic_ns();
            if (left_ns <= 0) return 0;
            std::array<pollfd, 1> fds{{{fd_.get(), POLLIN, 0}}};
            wait_ready(fds, left_ns);
        }
    }
    [[nodiscard]] std::string description() const override { return description_; }

private:
    Descriptor fd_;
    std::string description_;
    LossCount losses_;
};

}  // namespace

Result<std::unique_ptr<PacketSink>> open_udp_sink(const std::string& address, const LidarNetwork& network) {
    const auto [host, port_text] = split_port(address);
    if (host.empty()) return Error{"udp:" + address + ": expected udp:HOST:PORT, as in udp:127.0.0.1:2368"};
    const Result<int> port = data_port(port_text, address, network.position_port_offset());
    if (!port) return port.error();
    const Result<Destination> destination = resolve(host, address);
    if (!destination) return destination.error();

    // Not connected: on a connected socket an ICMP "port unreachable" makes the next send fail.
    Descriptor fd(::socket(destination->address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (!fd) return Error{"udp:" + address + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    const int on = 1;  // as the instrument does
    ::setsockopt(fd.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
    return std::unique_ptr<PacketSink>(
        std::make_unique<UdpSink>(std::move(fd), *destination, *port, network.position_port_offset(), host));
}

Result<std::unique_ptr<PacketSource>> open_packet_source(std::string_view spec) {
    constexpr std::string_view scheme = "udp:";
    const std::string name = "packet source \"" + std::string(spec) + "\"";
    const std::string_view rest = spec.starts_with(scheme) ? spec.substr(scheme.size()) : std::string_view{};
    const auto [host, port] = split_port(rest);
    const std::string address = rest.find(':') == rest.npos ? "0.0.0.0" : host;
    if (address.empty() || !udp_port(port))
        return Error{name + ": expected udp:PORT or udp:ADDRESS:PORT with a port from 1 to 65535, as in udp:2368"};

    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    if (const int failure = ::getaddrinfo(address.c_str(), port.c_str(), &hints, &found); failure != 0)
        return Error{name + ": \"" + address + "\" is not an address: " + ::gai_strerror(failure)};
    Descriptor fd(::socket(found->ai_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const bool bound = fd && ::bind(fd.get(), found->ai_addr, found->ai_addrlen) == 0;
    const int reason = errno;
    ::freeaddrinfo(found);
    if (!bound) {
        Error error{name + ": cannot listen: " + std::strerror(reason), {}, 0, 0, ErrorKind::missing};
        if (reason == EADDRINUSE)
            error.remedy = "another port, or see who has it: ss -lunp 'sport = :" + port + "'";
        if (reason == EADDRNOTAVAIL) error.remedy = "ip -br address   (the addresses of this machine)";
        return error;
    }
    prepare_for_bursts(fd.get());
    return std::unique_ptr<PacketSource>(
        std::make_unique<UdpSource>(std::move(fd), "UDP at " + address + ", port " + port));
}

}  // namespace narpa
