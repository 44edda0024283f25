// Y4M to TCP clients, each of which gets the stream's header and then whole frames, the newest first.
//
// In real time nobody waits for a slow client: it keeps what is left of its frame, and the frames that come
// meanwhile are lost to it. In lockstep the run waits until each connected client has the frame; one that takes no
// byte for kPatience_ns is disconnected, so that no vanished machine holds the run for ever.
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <cassert>
#include <cerrno>
#include <exception>

#include "drivers/descriptor.h"
#include "drivers/tcp_listener.h"
#include "drivers/video/y4m_writer.h"

namespace narpa {
namespace {

constexpr std::size_t kVideoClients = 64;
constexpr std::int64_t kPatience_ns = 10 * kSecond_ns;
/// The kernel's send buffer for a client: what is in it is old when a slow client reads it.
constexpr int kSendBytes = 128 << 10;

class TcpWriter final : public Y4mWriter {
public:
    TcpWriter(Descriptor listener, const VideoSinkOptions& o, std::string header)
        : Y4mWriter(o.format, std::move(header)),
          listener_(std::move(listener)),
          waits_(o.full == WhenFull::wait),
          bytes_most_(link_bytes(o.format) + kTextBytes) {
        clients_.reserve(kVideoClients);
    }

    void write_frame(std::span<const std::uint8_t> frame, const FrameStamp&,
                     const WriteQueue& queue) noexcept override {
        samples_ = samples(frame);
        ++frame_;
        assert(samples_.size() + kTextBytes == bytes_most_);
        for (bool has_next = false;;) {
            accept_clients();
            std::erase_if(clients_, [this](Client& c) { return !serve(c); });
            const bool all_have_it =
                std::ranges::all_of(clients_, [this](const Client& c) { return has_frame(c); });
            if (all_have_it || (has_next && !waits_) || queue.time_left_ms() == 0) break;
            has_next = wait(queue);
        }
        if (clients_.empty() && newest_written_ < frame_) ++no_reader;
        for (Client& c : clients_) {
            if (c.frame < frame_) ++failed;  // it misses this one
            if (c.frame == frame_ && !c.left.empty()) c.left.move_to(c.kept);
        }
    }

private:
    struct Client {
        Descriptor fd{};
        Y4mPieces left{};                  ///< of `frame`
        std::vector<std::uint8_t> kept{};  ///< holds them once the next frame has come
        std::uint64_t frame = 0;           ///< number of the newest one begun; 0: none
        std::int64_t t_progress_ns = 0;
    };

    [[nodiscard]] bool has_frame(const Client& c) const noexcept { return c.frame == frame_ && c.left.empty(); }

    void accept_clients() noexcept {
        while (clients_.size() < kVideoClients) {
            Descriptor fd(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
            if (!fd) return;
            const int on = 1;
            ::setsockopt(fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
            ::setsockopt(fd.get(), SOL_SOCKET, SO_SNDBUF, &kSendBytes, sizeof kSendBytes);
            try {
                Client client{.fd = std::move(fd)};
                client.kept.reserve(bytes_most_);
                clients_.push_back(std::move(client));
            } catch (const std::exception&) {  // no memory: the connection closes
                return;
            }
            if (had_client_) ++reconnects;
            had_client_ = true;
        }
    }

    /// Sends what goes without waiting; false: the client has gone, or was too slow in lockstep.
    bool serve(Client& c) noexcept {
        if (has_left(c)) return false;
        while (!has_frame(c)) {
            if (c.left.empty()) {
                c.left = pieces(samples_, c.frame == 0);
                c.frame = frame_;
                c.t_progress_ns = monotonic_ns();
            }
            const ssize_t n = c.left.write_to(c.fd.get());
            if (n < 0 && errno == EINTR) continue;
            if (n < 0 && errno == EAGAIN) return !gave_up(c);
            if (n <= 0) return false;
            c.t_progress_ns = monotonic_ns();
            if (c.left.empty() && c.frame > newest_written_) {
                newest_written_ = c.frame;
                ++written;
            }
        }
        return true;
    }

    /// Clients have nothing to say; what they send is discarded.
    static bool has_left(const Client& c) noexcept {
        std::array<char, 4096> ignored;
        const ssize_t n = ::recv(c.fd.get(), ignored.data(), ignored.size(), MSG_DONTWAIT);
        return n == 0 || (n < 0 && errno != EAGAIN && errno != EINTR);
    }

    bool gave_up(const Client& c) noexcept {
        const bool late = waits_ && monotonic_ns() - c.t_progress_ns > kPatience_ns;
        if (late) ++failed;
        return late;
    }

    /// Waits for a client or the next frame, for a short time; true: there is a next frame.
    bool wait(const WriteQueue& queue) noexcept {
        std::array<pollfd, kVideoClients + 2> fds{};
        fds[1] = {clients_.size() < kVideoClients ? listener_.get() : -1, POLLIN, 0};
        std::size_t n = 2;
        for (const Client& c : clients_)
            fds[n++] = {c.fd.get(), static_cast<short>(has_frame(c) ? POLLIN : POLLIN | POLLOUT), 0};
        return queue.wait(std::span(fds).first(n), kPollPeriodMs);
    }

    static constexpr std::size_t kTextBytes = 256;  ///< most of the stream's and the frame's headers

    Descriptor listener_;
    bool waits_, had_client_ = false;
    std::size_t bytes_most_;
    std::vector<Client> clients_{};
    std::span<const std::uint8_t> samples_{};       ///< of the frame being written
    std::uint64_t frame_ = 0, newest_written_ = 0;  ///< numbers, from 1
};

}  // namespace

VideoSinkResult open_tcp_sink(const std::string& address, const VideoSinkOptions& o) {
    const std::string what = "tcp:" + address + ": ";
    const auto at = parse_listen_address(address);
    if (!at) return Error{what + "expected tcp:[ADDRESS:]PORT, such as tcp:5000"};
    Result<std::string> header = y4m_stream_header(o.format);
    if (!header) return Error{what + header.error().what};
    auto listener = listen_tcp(at->host, at->port);
    if (!listener) return Error{what + listener.error().what, {}, 0, 0, listener.error().kind};
    const std::string url = "tcp://" + at->host + ":" + std::to_string(listener->port);
    return queued_sink(std::make_unique<TcpWriter>(std::move(listener->fd), o, *std::move(header)), o.format,
                       o.full, "Y4M at " + url + " to each client that connects");
}

}  // namespace narpa
