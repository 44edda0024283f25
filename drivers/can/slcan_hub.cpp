// The slcan hub: clients connect over TCP or over one pseudo-terminal; all of them and narpa share the bus.
// Wire: protocols/can/slcan.h.
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <termios.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "drivers/can/buses.h"
#include "drivers/can/client_hub.h"
#include "drivers/can/slcan_stream.h"
#include "drivers/tcp_listener.h"

namespace narpa {
namespace {

constexpr std::size_t kTcpClients = 8, kPty = kTcpClients, kClients = kTcpClients + 1;

struct Client {
    SlcanStream stream{};
    bool open = false;             ///< it has sent O or L: it is on the bus
    bool listens_only = false;     ///< it has sent L: it sends no frames
    bool takes_fd = false;         ///< it has sent Y (data bit rate) or a CAN FD frame: it is sent such frames
    std::uint64_t connection = 0;  ///< serial number of the connection
    bool commands = false;         ///< it has sent a command
    std::uint64_t overlong = 0;
    std::int64_t t_full_ns = 0;  ///< since when its send queue has been too full for others' frames; 0: it keeps up
};

/// A frame and the connection that it came on.
struct QueuedFrame {
    ReceivedFrame received{};
    std::size_t client = 0;
    std::uint64_t connection = 0;
};

/// Receive queue of fixed size.
class FrameQueue {
public:
    [[nodiscard]] bool empty() const noexcept { return begin_ == end_; }
    [[nodiscard]] std::size_t free() const noexcept { return frames_.size() - (end_ - begin_); }
    void push(const QueuedFrame& f) noexcept { frames_[end_++ % frames_.size()] = f; }
    [[nodiscard]] const QueuedFrame& pop() noexcept { return frames_[begin_++ % frames_.size()]; }

private:
    std::vector<QueuedFrame> frames_{4096};
    std::size_t begin_ = 0, end_ = 0;
};

/// No read brings more frames than this: the shortest line is "t1230" and CR.
constexpr std::size_t kFramesPerRead = SlcanStream::kReadBytes / 6 + 1;
/// Bytes that they need in another client's send queue.
constexpr std::size_t kRoomForRead = kFramesPerRead * kSlcanMaxLine;
/// The kernel's send buffer for a client: the larger it is, the later POLLOUT reports room again.
constexpr int kSocketBytes = 128 << 10;
/// How long all clients wait for one that does not read. After that it misses frames.
constexpr std::int64_t kTimeout_ns = 1000'000'000;

class SlcanHub final : public CanBus, public ClientHub {
public:
    SlcanHub(Descriptor listener, ListenAddress at, Descriptor pty_near, Descriptor pty_far, std::string pty_path)
        : listener_(std::move(listener)),
          pty_far_(std::move(pty_far)),
          at_(std::move(at)),
          pty_path_(std::move(pty_path)) {
        clients_[kPty].stream.attach(std::move(pty_near));
    }

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        if (queue_.empty()) serve();
        if (queue_.empty()) return false;
        newest_ = queue_.pop();
        out = newest_.received;
        ++counters_.received;
        return true;
    }

    [[nodiscard]] ClientHub* clients() noexcept override { return this; }

    void note_commander() noexcept override {
        had_commander_ = true;
        Client& from = clients_[newest_.client];
        if (from.open && from.connection == newest_.connection) from.commands = true;  // else it has left already
    }
    [[nodiscard]] bool commanders_left() const noexcept override {
        return had_commander_ && queue_.empty() &&
               std::none_of(clients_.begin(), clients_.end(), [](const Client& c) { return c.open && c.commands; });
    }
    [[nodiscard]] bool has_clients() const noexcept override {
        return std::any_of(clients_.begin(), clients_.end(), [](const Client& c) { return c.open; });
    }
    [[nodiscard]] std::uint64_t clients_left() const noexcept override { return clients_left_; }

    bool send(const CanFrame& frame) noexcept override {
        std::array<char, kSlcanMaxLine> line;
        const std::size_t n = sendable(frame) ? encode_slcan(padded(frame), line) : 0;
        const Delivery delivery = n > 0 ? deliver({line.data(), n}, frame.fd, nullptr) : Delivery{};
        if (delivery.taken > 0)
            ++counters_.sent;
        else if (delivery.missed == 0)
            ++counters_.send_drops;
        return delivery.taken > 0;
    }

    void wait(std::int64_t timeout_ns) noexcept override {
        if (!queue_.empty()) return;
        std::array<pollfd, kClients + 2> fds{};
        fds[kClients] = {listener_.get(), POLLIN, 0};
        fds[kClients + 1] = {wake_fd_, POLLIN, 0};
        bool held_up = false;
        for (std::size_t i = 0; i < kClients; ++i) {
            const SlcanStream& s = clients_[i].stream;
            const bool may_send = others_keep_up(clients_[i]);
            held_up = held_up || !may_send;
            fds[i] = {s.fd(), static_cast<short>((may_send ? POLLIN : 0) | (s.pending() ? POLLOUT : 0)), 0};
        }
        const bool patience_ends_first = held_up && (timeout_ns < 0 || timeout_ns > kTimeout_ns);
        wait_ready(fds, patience_ends_first ? kTimeout_ns : timeout_ns);
    }

    [[nodiscard]] bool carries_fd() const noexcept override { return false; }
    [[nodiscard]] std::string description() const override {
        return "slcan: " + to_string(at_) + " and " + pty_path_ +
               (is_loopback(at_) ? "" : "; warning: any machine that reaches this address can send commands");
    }
    [[nodiscard]] CanAddress address() const override {
        const bool here = is_loopback(at_) || at_.host == "0.0.0.0";
        return {"slcan:" + (here ? std::to_string(at_.port) : to_string(at_)), pty_path_};
    }

private:
    struct Delivery {
        std::uint64_t taken = 0, missed = 0;  ///< clients
    };

    void serve() noexcept {
        accept_clients();
        for (Client& client : clients_) {
            if (!client.stream) continue;
            client.stream.flush();
            // Without room the data stays in the client's socket: the client is slowed down, and nothing is lost.
            if (queue_.free() >= kFramesPerRead && others_keep_up(client)) serve(client);
        }
    }

    /// All other clients have room for what this one may send.
    bool others_keep_up(const Client& sender) noexcept {
        bool all = true;
        for (Client& c : clients_)
            if (&c != &sender) all = keeps_up(c) && all;
        return all;
    }
    static bool keeps_up(Client& client) noexcept {
        if (!client.open || client.stream.room() >= kRoomForRead) {
            client.t_full_ns = 0;
            return true;
        }
        if (client.t_full_ns == 0) client.t_full_ns = monotonic_ns();
        return monotonic_ns() - client.t_full_ns > kTimeout_ns;
    }

    void accept_clients() noexcept {
        for (;;) {
            Descriptor fd(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
            if (!fd) return;
            const int on = 1;
            ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
            ::setsockopt(fd.get(), SOL_SOCKET, SO_SNDBUF, &kSocketBytes, sizeof kSocketBytes);
            for (std::size_t i = 0; i < kTcpClients; ++i) {
                if (clients_[i].stream) continue;
                clients_[i].stream.attach(std::move(fd));
                Client& joined = clients_[i];
                joined.open = joined.commands = joined.listens_only = joined.takes_fd = false;
                clients_[i].connection = ++connections_;
                clients_[i].overlong = 0;
                break;
            }  // no slot left: fd closes, and the client sees it
        }
    }

    void serve(Client& client) noexcept {
        const bool there = client.stream.read();
        std::string_view line;
        while (client.stream.next_line(line)) execute(client, line);
        for (; client.overlong < client.stream.overlong(); ++client.overlong) refuse(client);
        if (there || &client == &clients_[kPty]) return;
        client.stream.close();
        client.open = false;
        ++clients_left_;
    }

    void execute(Client& client, std::string_view line) noexcept {
        const bool bare = line.size() == 1;
        switch (line[0]) {
            case 'O':
            case 'L':
            case 'C':
                if (!bare) return refuse(client);
                client.open = line[0] != 'C', client.listens_only = line[0] == 'L';
                if (!client.open) client.commands = false;
                if (&client == &clients_[kPty] && !client.open) discard_unread(client);
                return answer(client, "\r");
            case 'Y': client.takes_fd = true; [[fallthrough]];
            case 'S':
                return line.size() == 2 && line[1] >= '0' && line[1] <= '9' ? answer(client, "\r") : refuse(client);
            case 'V': return bare ? answer(client, "V1013\r") : refuse(client);
            case 'N': return bare ? answer(client, "NNRP1\r") : refuse(client);
            case 'F': return bare ? answer(client, "F00\r") : refuse(client);
            default: return take_frame(client, line);
        }
    }

    void take_frame(Client& client, std::string_view line) noexcept {
        ReceivedFrame received;
        if (!client.open || client.listens_only || !decode_slcan(line, received.frame)) return refuse(client);
        received.t_received_ns = monotonic_ns();
        client.takes_fd = client.takes_fd || received.frame.fd;
        queue_.push({received, static_cast<std::size_t>(&client - clients_.data()), client.connection});
        answer(client, received.frame.extended ? "Z\r" : "z\r");
        std::array<char, kSlcanMaxLine> text;
        const std::size_t n = encode_slcan(received.frame, text);
        deliver({text.data(), n}, received.frame.fd, &client);
    }

    /// Sends to every open client but `from`, CAN FD frames to those that take them. A client whose queue is full
    /// misses the line; this is counted.
    Delivery deliver(std::string_view line, bool fd, const Client* from) noexcept {
        Delivery delivery;
        for (Client& client : clients_)
            if (client.open && &client != from && (client.takes_fd || !fd))
                ++(client.stream.write(line) ? delivery.taken : delivery.missed);
        counters_.send_drops += delivery.missed;
        return delivery;
    }

    void answer(Client& client, std::string_view text) noexcept {
        if (!client.stream.write(text)) ++counters_.send_drops;
    }
    void refuse(Client& client) noexcept {
        ++counters_.malformed;
        answer(client, "\a");
    }

    /// Unread data on the pty would otherwise reach the next program that opens it.
    void discard_unread(Client& client) noexcept {
        client.stream.discard();
        ::tcflush(pty_far_.get(), TCIFLUSH);
    }

    Descriptor listener_, pty_far_;
    ListenAddress at_;
    std::string pty_path_;
    std::array<Client, kClients> clients_{};
    FrameQueue queue_{};
    QueuedFrame newest_{};
    std::uint64_t connections_ = 0, clients_left_ = 0;
    bool had_commander_ = false;
};

Error failed(const std::string& what) {
    return {.what = what + ": " + std::strerror(errno), .kind = ErrorKind::missing};
}

}  // namespace

CanBusResult open_slcan(const std::string& text, CanRole role) {
    const auto at = parse_listen_address(text);
    // Port 0 lets the kernel choose; only a listening socket can do that.
    if (!at || (at->port == 0 && role == CanRole::client))
        return Error{"slcan:" + text +
                     ": expected [ADDRESS:]PORT with an IPv4 address and a TCP port from 1 to 65535, such as "
                     "slcan:29537 or slcan:192.168.1.10:29537"};
    return role == CanRole::hub ? open_slcan_hub(*at) : open_slcan_client(*at);
}

CanBusResult open_slcan_hub(const ListenAddress& at) {
    const std::string name = "slcan:" + to_string(at);
    auto listener = listen_tcp(at.host, at.port);
    if (!listener) {
        Error error = listener.error();
        error.what = name + ": " + error.what;
        ListenAddress other = at;
        other.port = static_cast<std::uint16_t>(at.port < 65535 ? at.port + 1 : 29537);
        error.remedy =
            "another port, such as slcan:" + (is_loopback(at) ? std::to_string(other.port) : to_string(other)) +
            ", or see who has it: ss -ltnp 'sport = :" + std::to_string(at.port) + "'";
        return error;
    }

    Descriptor near(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    std::array<char, 64> path{};
    if (!near || ::grantpt(near.get()) != 0 || ::unlockpt(near.get()) != 0 ||
        ::ptsname_r(near.get(), path.data(), path.size()) != 0)
        return failed(name + ": cannot make a pseudo-terminal");
    // The far end stays open here, so that a client that closes it does not hang up the near end.
    Descriptor far(::open(path.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
    termios mode{};
    if (!far || ::tcgetattr(far.get(), &mode) != 0) return failed(name + ": " + path.data());
    ::cfmakeraw(&mode);
    if (::tcsetattr(far.get(), TCSANOW, &mode) != 0) return failed(name + ": " + path.data());
    return CanBusResult(std::make_unique<SlcanHub>(std::move(listener->fd), ListenAddress{at.host, listener->port},
                                                   std::move(near), std::move(far), path.data()));
}

}  // namespace narpa
