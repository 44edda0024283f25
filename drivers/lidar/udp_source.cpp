#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>

#include "drivers/can/datagram.h"
#include "drivers/can/descriptor.h"
#include "drivers/lidar/packet_source.h"

namespace narpa {
namespace {

class UdpSource final : public PacketSource {
public:
    UdpSource(Descriptor fd, std::string description) : fd_(std::move(fd)), description_(std::move(description)) {}

    [[nodiscard]] std::size_t receive(std::span<std::uint8_t> bytes, std::int64_t timeout_ns) noexcept override {
        const std::int64_t until_ns = monotonic_ns() + timeout_ns;
        for (;;) {
            const Datagram d = receive_datagram(fd_.get(), bytes);
            if (d.bytes >= 0) {
                note_lost(d.lost);
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
    /// The kernel's count has 32 bits and wraps.
    void note_lost(std::uint32_t total) noexcept {
        if (total == 0) return;
        counters_.lost += static_cast<std::uint32_t>(total - lost_);
        lost_ = total;
    }

    Descriptor fd_;
    std::string description_;
    std::uint32_t lost_ = 0;
};

bool is_port(std::string_view text) noexcept {
    std::uint16_t port = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), port);
    return failure == std::errc{} && end == text.data() + text.size() && port != 0;
}

}  // namespace

Result<std::unique_ptr<PacketSource>> open_packet_source(std::string_view spec) {
    constexpr std::string_view scheme = "udp:";
    const std::string name = "packet source \"" + std::string(spec) + "\"";
    const std::string_view rest = spec.starts_with(scheme) ? spec.substr(scheme.size()) : std::string_view{};
    const std::size_t colon = rest.rfind(':');
    const std::string port(colon == rest.npos ? rest : rest.substr(colon + 1));
    std::string address(colon == rest.npos ? std::string_view("0.0.0.0") : rest.substr(0, colon));
    if (address.starts_with('[') && address.ends_with(']')) address = address.substr(1, address.size() - 2);
    if (rest.empty() || address.empty() || !is_port(port))
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
