// The sink `ouster:[ADDRESS:]PORT`: the HTTP server of an Ouster sensor, and its packets to the destination that a
// driver sets.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "drivers/datagram.h"
#include "drivers/descriptor.h"
#include "drivers/http/http_server.h"
#include "drivers/lidar/backends.h"
#include "drivers/lidar/ouster_api.h"
#include "drivers/tcp_listener.h"

namespace narpa {
namespace {

/// Written by the server's thread, read by the loop's: an IPv4 address and a port in network order; 0: nowhere.
class SharedDestination {
public:
    void set(const OusterDestination& to) noexcept {
        in_addr address{};
        const bool some = ::inet_pton(AF_INET, to.address.c_str(), &address) == 1;
        packed_.store(some ? std::uint64_t{address.s_addr} << 16 | htons(to.port_lidar) : 0,
                      std::memory_order_relaxed);
    }
    [[nodiscard]] std::optional<sockaddr_in> get() const noexcept {
        const std::uint64_t packed = packed_.load(std::memory_order_relaxed);
        if (packed == 0) return std::nullopt;
        sockaddr_in to{};
        to.sin_family = AF_INET;
        to.sin_addr.s_addr = static_cast<in_addr_t>(packed >> 16);
        to.sin_port = static_cast<in_port_t>(packed);
        return to;
    }

private:
    std::atomic<std::uint64_t> packed_{0};
};

class OusterSink final : public PacketSink {
public:
    OusterSink(Descriptor fd, OusterApi api, std::string description)
        : fd_(std::move(fd)), api_(std::move(api)), description_(std::move(description)) {}

    Status serve(const std::string& address, std::uint16_t port) {
        auto server = HttpServer::start(address, port, [this](const HttpRequest& request) {
            HttpResponse response = api_.answer(request);
            destination_.set(api_.destination());
            return response;
        });
        if (!server) return server.error();
        server_ = *std::move(server);
        return Ok{};
    }

    bool send(PacketKind, std::span<const std::uint8_t> payload, std::int64_t) noexcept override {
        const auto to = destination_.get();
        if (!to) return true;  // no driver has asked for packets
        const bool sent = send_datagram(fd_.get(), payload, reinterpret_cast<const sockaddr*>(&*to), sizeof *to);
        ++(sent ? sent_ : dropped_);
        return sent;
    }
    void flush() noexcept override {}
    PacketCounters counters() const noexcept override { return {sent_, dropped_}; }
    std::string description() const override { return description_; }

private:
    Descriptor fd_;
    OusterApi api_;  ///< of the server's thread
    SharedDestination destination_;
    std::string description_;
    std::atomic<std::uint64_t> sent_{0}, dropped_{0};
    std::unique_ptr<HttpServer> server_;  ///< declared last, so that its thread ends before what it uses
};

}  // namespace

PacketSinkResult open_ouster_sink(const std::string& address, const PacketSinkOptions& o) {
    const auto at = parse_listen_address(address);
    if (!at || at->port == 0)
        return Error{"ouster:" + address + ": expected ouster:PORT or ouster:ADDRESS:PORT, as in ouster:8080"};
    auto api = OusterApi::create(std::string(o.metadata));
    if (!api) return Error{"ouster:" + address + ": " + api.error().what};
    Descriptor fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (!fd) return Error{"ouster:" + address + ": " + std::strerror(errno), {}, 0, 0, ErrorKind::missing};
    const int on = 1;
    ::setsockopt(fd.get(), SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
    auto sink = std::make_unique<OusterSink>(std::move(fd), *std::move(api),
                                             "Ouster sensor, http://" + at->host + ":" + std::to_string(at->port) +
                                                 "/api/v1, UDP to where a driver asks for it");
    if (auto served = sink->serve(at->host, at->port); !served) {
        Error error = served.error();
        error.what = "ouster:" + address + ": " + error.what;
        return error;
    }
    return std::unique_ptr<PacketSink>(std::move(sink));
}

}  // namespace narpa
