// The client side of slcan: connects to a hub, opens the channel, and returns when the hub does.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "drivers/can/buses.h"
#include "drivers/can/slcan_stream.h"

namespace narpa {
namespace {

enum class Connection : std::uint8_t { made, under_way, refused };

sockaddr_in address_of(const ListenAddress& hub) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(hub.port);
    ::inet_pton(AF_INET, hub.host.c_str(), &address.sin_addr);
    return address;
}

/// Starts to connect; `under_way` when the answer takes a moment, as it may even on loopback.
Connection connect_to(const sockaddr_in& hub, Descriptor& fd) noexcept {
    fd = Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!fd) return Connection::refused;
    const int on = 1;
    ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&hub), sizeof hub) == 0) return Connection::made;
    return errno == EINPROGRESS ? Connection::under_way : Connection::refused;
}

/// The result of a pending connect(); errno has the reason of a failure.
Connection outcome(int fd, std::int64_t timeout_ns) noexcept {
    std::array<pollfd, 1> fds{{{fd, POLLOUT, 0}}};
    wait_ready(fds, timeout_ns);
    if (fds[0].revents == 0) return Connection::under_way;
    int reason = 0;
    socklen_t bytes = sizeof reason;
    ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &reason, &bytes);
    errno = reason;
    return reason == 0 ? Connection::made : Connection::refused;
}

constexpr std::array<std::string_view, 3> kGreeting{"C\r", "S8\r", "O\r"};
constexpr std::int64_t kAnswerTimeout_ns = 5 * kSecond_ns;  // the hub may be busy

/// Opens the channel and waits for the hub's answers: from then on no frame of the bus is missed. A hub sends
/// nothing else before, so what comes after the answers is left in the socket.
Status greet(int fd) {
    const auto failed = [] {
        const bool hung_up = errno == 0 || errno == EPIPE || errno == ECONNRESET;
        return Error{hung_up ? "connection closed: the hub has reached its limit of clients"
                             : std::strerror(errno)};
    };
    for (const std::string_view line : kGreeting)
        if (::send(fd, line.data(), line.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(line.size()))
            return failed();
    const std::int64_t until_ns = monotonic_ns() + kAnswerTimeout_ns;
    for (std::size_t answers = 0; answers < kGreeting.size();) {
        std::array<pollfd, 1> fds{{{fd, POLLIN, 0}}};
        wait_ready(fds, std::max<std::int64_t>(until_ns - monotonic_ns(), 0));
        char answer = 0;
        errno = 0;
        const ssize_t n = ::recv(fd, &answer, 1, 0);
        if (n == 1 && answer != '\r') return Error{"no slcan hub: it does not answer as one"};
        if (n == 1) ++answers;
        if (n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR)) return failed();
        if (n < 0 && monotonic_ns() >= until_ns) return Error{"it does not answer"};
    }
    return Ok{};
}

class SlcanClient final : public CanBus {
public:
    /// `fd`: connected, with the channel open.
    SlcanClient(Descriptor fd, const ListenAddress& hub) : hub_(hub), address_(address_of(hub)) {
        stream_.attach(std::move(fd));
    }
    ~SlcanClient() override {
        if (stream_ && stream_.write("C\r")) stream_.flush();
    }

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        for (;;) {
            std::string_view line;
            while (stream_.next_line(line)) {
                count_overlong();
                if (decode_slcan(line, out.frame)) {
                    out.t_received_ns = monotonic_ns();
                    ++counters_.received;
                    return true;
                }
                // z and Z acknowledge our frames; no hub sends any other line unasked.
                if (line != "z" && line != "Z") ++counters_.malformed;
            }
            count_overlong();
            if (!ready()) return false;
            stream_.flush();
            if (!stream_.read()) {
                stream_.close();
                overlong_ = 0;
                ++counters_.interface_down;
                return false;
            }
            if (!stream_.unread()) return false;
        }
    }

    bool send(const CanFrame& frame) noexcept override {
        std::array<char, kSlcanMaxLine> line;
        const std::size_t n = sendable(frame) ? encode_slcan(padded(frame), line) : 0;
        const bool taken = n > 0 && ready() && stream_.write({line.data(), n});
        ++(taken ? counters_.sent : counters_.send_drops);
        return taken;
    }

    void wait(std::int64_t timeout_ns) noexcept override {
        if (stream_.unread()) return;
        const bool write_too = stream_.pending() || connecting_;
        std::array<pollfd, 2> fds{{{stream_ ? stream_.fd() : connecting_.get(),
                                    static_cast<short>(write_too ? POLLIN | POLLOUT : POLLIN), 0},
                                   {wake_fd_, POLLIN, 0}}};
        wait_ready(fds, stream_ ? timeout_ns : retry_.limit(timeout_ns));
    }

    [[nodiscard]] bool carries_fd() const noexcept override { return false; }
    [[nodiscard]] std::string description() const override { return "slcan: client of " + to_string(hub_); }

private:
    /// Opens the channel of a new connection; does not wait for the answers.
    void begin(Descriptor fd) noexcept {
        stream_.attach(std::move(fd));
        for (const std::string_view line : kGreeting)
            if (!stream_.write(line)) ++counters_.send_drops;
    }

    /// Connected, after a new try if needed.
    bool ready() noexcept {
        if (stream_) return true;
        Connection connection = Connection::refused;
        if (connecting_)
            connection = outcome(connecting_.get(), 0);
        else if (retry_.due())
            connection = connect_to(address_, connecting_);
        if (connection == Connection::made) begin(std::move(connecting_));
        if (connection == Connection::refused) connecting_.reset();
        return static_cast<bool>(stream_);
    }

    void count_overlong() noexcept {
        counters_.malformed += stream_.overlong() - overlong_;
        overlong_ = stream_.overlong();
    }

    SlcanStream stream_{};
    Descriptor connecting_{};
    ListenAddress hub_;
    sockaddr_in address_;
    std::uint64_t overlong_ = 0;
    RetryTimer retry_{};
};

}  // namespace

CanBusResult open_slcan_client(const ListenAddress& at) {
    const std::string hub = to_string(at), spec = "slcan:" + (is_loopback(at) ? std::to_string(at.port) : hub);
    const auto failed = [&](const std::string& what) {
        return Error{.what = spec + ": " + what,
                     .kind = ErrorKind::missing,
                     .remedy = "narpa run SCENE --can " + spec + " --video CAMERA=none   (start the hub first)"};
    };
    Descriptor fd;
    Connection connection = connect_to(address_of(at), fd);
    if (connection == Connection::under_way) connection = outcome(fd.get(), kSecond_ns);
    if (connection != Connection::made) return failed("cannot connect to " + hub + ": " + std::strerror(errno));
    if (const Status greeted = greet(fd.get()); !greeted) return failed(hub + ": " + greeted.error().what);
    return CanBusResult(std::make_unique<SlcanClient>(std::move(fd), at));
}

}  // namespace narpa
