#include "drivers/usb/usbip_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <exception>
#include <utility>

#include "base/time.h"
#include "drivers/background_thread.h"
#include "drivers/tcp_listener.h"
#include "drivers/usb/usb_control.h"

namespace narpa {

/// Reads requests, keeps the transfers that are pending, writes the answers; never waits.
class UsbIpServer::Connection {
public:
    Connection(Descriptor fd, UsbIpServer& server)
        : fd_(std::move(fd)), server_(server), until_ns_(monotonic_ns() + kTimeout_ns) {}

    [[nodiscard]] bool imported() const noexcept { return imported_; }
    [[nodiscard]] pollfd wanted() const noexcept {
        const bool reads = unsent() < kMaxUnsent && !closing_;
        return {fd_.get(), static_cast<short>((reads ? POLLIN : 0) | (unsent() > 0 ? POLLOUT : 0)), 0};
    }
    /// Deadline of a connection that has not imported the device.
    [[nodiscard]] std::int64_t until_ns() const noexcept { return imported_ ? INT64_MAX : until_ns_; }

    /// False: the connection has ended.
    bool proceed(short ready) {
        if (monotonic_ns() >= until_ns()) return false;
        if ((ready & (POLLERR | POLLHUP)) != 0 && (ready & POLLIN) == 0) return false;
        if ((ready & POLLIN) != 0 && !read_some()) return false;
        if (imported_) serve();
        return write_some() && !(closing_ && unsent() == 0);
    }

private:
    static constexpr std::size_t kMaxUnsent = 4 << 20, kMaxHeld = 4 << 20;  // bytes
    struct Transfer {
        UsbIpSubmit submit;
        std::vector<std::uint8_t> data;  // from the host
    };

    [[nodiscard]] std::size_t unsent() const noexcept { return out_.size() - out_begin_; }

    bool read_some() {
        std::array<std::uint8_t, 65536> bytes;
        const ssize_t n = ::recv(fd_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
        if (n < 0) return errno == EAGAIN || errno == EINTR;
        if (n == 0) return false;
        in_.insert(in_.end(), bytes.begin(), bytes.begin() + n);
        std::size_t used = 0;
        while (!closing_) {
            const auto rest = std::span<const std::uint8_t>(in_).subspan(used);
            const long taken = imported_ ? take_transfer(rest) : take_op(rest);
            if (taken < 0) {
                ++server_.refused_;
                return false;
            }
            if (taken == 0) break;
            used += static_cast<std::size_t>(taken);
        }
        in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(used));
        return true;
    }

    /// Bytes taken; 0: more must come; -1: not USB/IP.
    long take_op(std::span<const std::uint8_t> bytes) {
        if (bytes.size() < kUsbIpOpBytes) return 0;
        const auto header = decode_usbip_op(bytes.first<kUsbIpOpBytes>());
        if (!header) return -1;
        if (header->op == UsbIpOp::list_request) {
            put(encode_usbip_list({&server_.identity_, 1}));
            closing_ = true;
            return kUsbIpOpBytes;
        }
        if (header->op != UsbIpOp::import_request) return -1;
        if (bytes.size() < kUsbIpOpBytes + kUsbIpBusIdBytes) return 0;
        const auto bus_id = decode_usbip_bus_id(bytes.subspan<kUsbIpOpBytes, kUsbIpBusIdBytes>());
        if (!bus_id) return -1;
        const bool busy = std::ranges::any_of(server_.connections_, [](const auto& c) { return c->imported(); });
        const std::uint32_t status = *bus_id != kBusId ? kUsbIpNoDevice : busy ? kUsbIpBusy : 0;
        if (status != 0) {
            put(encode_usbip_op({UsbIpOp::import_reply, status}));
            closing_ = true;
        } else {
            put(encode_usbip_import(server_.identity_));
            imported_ = true;
            ++server_.plugged_;
            server_.device_.plugged(true);
        }
        return kUsbIpOpBytes + kUsbIpBusIdBytes;
    }

    long take_transfer(std::span<const std::uint8_t> bytes) {
        if (bytes.size() < kUsbIpHeaderBytes) return 0;
        const auto request = decode_usbip_request(bytes.first<kUsbIpHeaderBytes>());
        if (!request) return -1;
        if (const auto* unlink = std::get_if<UsbIpUnlink>(&*request)) {
            give_up(*unlink);
            return kUsbIpHeaderBytes;
        }
        const auto& submit = std::get<UsbIpSubmit>(*request);
        const std::size_t follow = submit.to_host ? 0 : submit.length;
        if (bytes.size() < kUsbIpHeaderBytes + follow) return 0;
        if (transfers_.size() == kTransfers || held_bytes_ + follow > kMaxHeld) return -1;
        held_bytes_ += follow;
        const auto data = bytes.subspan(kUsbIpHeaderBytes, follow);
        transfers_.push_back({submit, {data.begin(), data.end()}});
        return static_cast<long>(kUsbIpHeaderBytes + follow);
    }

    void give_up(const UsbIpUnlink& unlink) {
        serve();  // transfers that can complete now were not cancelled in time
        const auto victim =
            std::ranges::find_if(transfers_, [&](const Transfer& t) { return t.submit.sequence == unlink.victim; });
        const bool pending = victim != transfers_.end();
        if (pending) {
            held_bytes_ -= victim->data.size();
            transfers_.erase(victim);
            ++server_.unlinked_;
        }
        const std::size_t at = room_for(kUsbIpHeaderBytes);
        encode_usbip_reply({true, unlink.sequence, pending ? -ECONNRESET : 0, 0},
                           std::span(out_).subspan(at).first<kUsbIpHeaderBytes>());
    }

    /// Completes the transfers that can be answered. Transfers of one endpoint and direction keep their order.
    void serve() {
        std::uint32_t held = 0;  // bit: endpoint, or 16 + endpoint towards the host
        for (auto t = transfers_.begin(); t != transfers_.end() && unsent() < kMaxUnsent;) {
            const std::uint32_t lane = 1u << ((t->submit.to_host ? 16 : 0) + t->submit.endpoint);
            if ((held & lane) != 0 || !answer(*t)) {
                held |= lane;
                ++t;
            } else {
                held_bytes_ -= t->data.size();
                t = transfers_.erase(t);
            }
        }
    }

    /// False: not yet.
    bool answer(Transfer& t) {
        const UsbIpSubmit& s = t.submit;
        const std::size_t at = room_for(kUsbIpHeaderBytes + (s.to_host ? s.length : 0));
        const auto room = std::span(out_).subspan(at + kUsbIpHeaderBytes);
        UsbDevice& device = server_.device_;
        int n = 0;
        if (s.endpoint == 0)
            n = s.setup.to_host() == s.to_host || s.length == 0
                    ? usb_control(device, s.setup, s.to_host ? room : std::span(t.data))
                    : UsbAnswer::kStall;
        else
            n = s.to_host ? device.give(s.endpoint, room) : device.take(s.endpoint, t.data);
        if (n == UsbAnswer::kPending) {
            out_.resize(at);
            return false;
        }
        const auto moved = static_cast<std::uint32_t>(std::clamp<std::int64_t>(n, 0, s.length));
        encode_usbip_reply({false, s.sequence, n < 0 ? n : 0, moved},
                           std::span(out_).subspan(at).first<kUsbIpHeaderBytes>());
        out_.resize(at + kUsbIpHeaderBytes + (s.to_host ? moved : 0));
        ++server_.transfers_;
        return true;
    }

    void put(std::span<const std::uint8_t> bytes) { out_.insert(out_.end(), bytes.begin(), bytes.end()); }
    /// Appends this many bytes to the output; returns the index of the first.
    std::size_t room_for(std::size_t bytes) {
        out_.resize(out_.size() + bytes);
        return out_.size() - bytes;
    }

    bool write_some() {
        while (unsent() > 0) {
            const ssize_t n = ::send(fd_.get(), out_.data() + out_begin_, unsent(), MSG_DONTWAIT | MSG_NOSIGNAL);
            if (n < 0) return errno == EAGAIN || errno == EINTR;
            out_begin_ += static_cast<std::size_t>(n);
        }
        out_.clear();
        out_begin_ = 0;
        return true;
    }

    Descriptor fd_;
    UsbIpServer& server_;
    std::int64_t until_ns_;
    bool imported_ = false, closing_ = false;
    std::vector<std::uint8_t> in_, out_;
    std::size_t out_begin_ = 0, held_bytes_ = 0;
    std::deque<Transfer> transfers_;
};

Result<std::unique_ptr<UsbIpServer>> UsbIpServer::start(const std::string& address, std::uint16_t port,
                                                        UsbDevice& device) {
    const UsbDescriptors& d = device.descriptors();
    const auto configuration = decode_usb_configuration(d.configuration);
    if (!configuration) return Error{"the USB device's configuration descriptor cannot be decoded"};
    auto listener = listen_tcp(address, port);
    if (!listener) return listener.error();
    Descriptor signal(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!signal) return Error{.what = std::string("eventfd: ") + std::strerror(errno), .kind = ErrorKind::missing};
    UsbIpDevice identity{
        "/sys/devices/narpa/" + std::string(kBusId), std::string(kBusId), 1, 2, d.speed, d.device, *configuration};
    return std::unique_ptr<UsbIpServer>(
        new UsbIpServer(std::move(listener->fd), std::move(signal), listener->port, std::move(identity), device));
}

UsbIpServer::UsbIpServer(Descriptor listening, Descriptor signal, std::uint16_t port, UsbIpDevice identity,
                         UsbDevice& device)
    : listening_(std::move(listening)),
      signal_(std::move(signal)),
      port_(port),
      identity_(std::move(identity)),
      device_(device) {
    connections_.reserve(kConnections);
    thread_ = start_without_signals([this] { run(); });
}

UsbIpServer::~UsbIpServer() {
    ending_.store(true, std::memory_order_release);
    wake();
    thread_.join();
}

void UsbIpServer::wake() noexcept {
    ::eventfd_write(signal_.get(), 1);
}

UsbIpCounters UsbIpServer::counters() const noexcept {
    return {plugged_, transfers_, unlinked_, refused_};
}

void UsbIpServer::run() noexcept {
    while (!ending_.load(std::memory_order_acquire)) {
        std::array<pollfd, 2 + kConnections> fds;
        fds[0] = {signal_.get(), POLLIN, 0};
        fds[1] = {connections_.size() == kConnections ? -1 : listening_.get(), POLLIN, 0};
        std::int64_t until_ns = monotonic_ns() + kTimeout_ns;
        for (std::size_t i = 0; i < connections_.size(); ++i) {
            fds[2 + i] = connections_[i]->wanted();
            until_ns = std::min(until_ns, connections_[i]->until_ns());
        }
        wait_ready(std::span(fds).first(2 + connections_.size()),
                   std::max<std::int64_t>(0, until_ns - monotonic_ns()));
        eventfd_t count = 0;
        if (fds[0].revents != 0) ::eventfd_read(signal_.get(), &count);
        try {
            for (std::size_t i = connections_.size(); i-- > 0;)
                if (!connections_[i]->proceed(fds[2 + i].revents)) drop(i);
            if (fds[1].revents != 0) accept_one();
        } catch (const std::exception&) {  // no memory left
            while (!connections_.empty()) drop(connections_.size() - 1);
        }
    }
    while (!connections_.empty()) drop(connections_.size() - 1);
}

void UsbIpServer::drop(std::size_t i) noexcept {
    if (connections_[i]->imported()) device_.plugged(false);
    connections_.erase(connections_.begin() + static_cast<std::ptrdiff_t>(i));
}

void UsbIpServer::accept_one() {
    Descriptor fd(::accept4(listening_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!fd) {
        if (errno == EMFILE || errno == ENFILE) wait_ready(std::span<pollfd>(), kTimeout_ns / 50);
        return;
    }
    // A host that has lost power is noticed within half a minute.
    const int on = 1, idle_s = 10, every_s = 5, times = 3;
    ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    ::setsockopt(fd.get(), SOL_SOCKET, SO_KEEPALIVE, &on, sizeof on);
    ::setsockopt(fd.get(), IPPROTO_TCP, TCP_KEEPIDLE, &idle_s, sizeof idle_s);
    ::setsockopt(fd.get(), IPPROTO_TCP, TCP_KEEPINTVL, &every_s, sizeof every_s);
    ::setsockopt(fd.get(), IPPROTO_TCP, TCP_KEEPCNT, &times, sizeof times);
    connections_.push_back(std::make_unique<Connection>(std::move(fd), *this));
}

}  // namespace narpa
