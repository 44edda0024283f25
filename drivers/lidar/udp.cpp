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

#include "base/text/read_number.h"
#include "drivers/datagram.h"
#include "drivers/descriptor.h"
#include "drivers/lidar/backends.h"
#include "drivers/lidar/packet_source.h"
#include "drivers/lidar/receiver_watch.h"
#include "drivers/udp_listener.h"
#include "drivers/udp_route.h"

namespace narpa {
namespace {

class UdpSink final : public PacketSink {
public:
    /// `position_port_offset`: 0 where there are no position packets.
    UdpSink(Descriptor fd, const UdpDestination& data, int port, int position_port_offset, const std::string& host)
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
        const UdpDestination& to = destinations_[kind == PacketKind::data ? 0 : 1];
        const bool sent =
            send_datagram(fd_.get(), payload, reinterpret_cast<const sockaddr*>(&to.address), to.size);
        ++(sent ? sent_ : dropped_);
        return sent;
    }
    void flush() noexcept override { receivers_.update(); }
    PacketCounters counters() const noexcept override { return {sent_, dropped_, receivers_.dropped()}; }
    std::string description() const override { return description_; }

private:
    Descriptor fd_;
    std::array<UdpDestination, 2> destinations_;
    ReceiverWatch receivers_;
    std::string description_;
    std::atomic<std::uint64_t> sent_{0}, dropped_{0};
};

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

PacketSinkResult open_udp_sink(const std::string& text, const PacketSinkOptions& o) {
    const int position_port_offset = o.network.position_port_offset();
    const auto address = UdpAddress::parse(text);
    if (!address) return address.error();
    const std::string what = "udp:" + text;
    if (address->host.empty()) return Error{what + ": expected udp:HOST:PORT, as in udp:127.0.0.1:2368"};
    const Result<int> port = data_port(address->port, text, position_port_offset);
    if (!port) return port.error();
    Result<UdpDestination> destination = UdpDestination::resolve(address->host, what);
    if (!destination) return destination.error();

    // Not connected: on a connected socket an ICMP "port unreachable" makes the next send fail.
    Descriptor fd(::socket(destination->address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (!fd) return Error{what + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    if (auto set = set_route(fd.get(), *destination, *address, what); !set) return set.error();
    std::string host = address->host;
    if (host != destination->text()) host += " (" + destination->text() + ")";
    if (!address->interface.empty()) host += " by " + address->interface;
    return std::unique_ptr<PacketSink>(
        std::make_unique<UdpSink>(std::move(fd), *destination, *port, position_port_offset, host));
}

Result<std::unique_ptr<PacketSource>> open_packet_source(std::string_view spec) {
    constexpr std::string_view scheme = "udp:";
    const std::string_view rest = spec.starts_with(scheme) ? spec.substr(scheme.size()) : std::string_view{};
    auto listener = listen_udp(rest, "packet source \"" + std::string(spec) + "\"");
    if (!listener) return listener.error();
    return std::unique_ptr<PacketSource>(std::make_unique<UdpSource>(
        std::move(listener->fd), "UDP at " + listener->host + ", port " + listener->port));
}

}  // namespace narpa
