#include "drivers/http/http_server.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <string_view>
#include <utility>

#include "base/time.h"
#include "drivers/background_thread.h"
#include "drivers/tcp_listener.h"

namespace narpa {
namespace {

std::string_view words_of(int status) {
    switch (status) {
        case 200: return "OK";
        case 400: return "Bad Request";
        case 404: return "Not Found";
        case 405: return "Method Not Allowed";
        case 408: return "Request Timeout";
        case 413: return "Content Too Large";
        case 431: return "Request Header Fields Too Large";
        case 501: return "Not Implemented";
        default: return "Internal Server Error";
    }
}

std::string bytes_of(const HttpResponse& r) {
    std::string text = "HTTP/1.1 " + std::to_string(r.status) + " ";
    text += words_of(r.status);
    text += "\r\nContent-Type: ";
    text += r.type;
    text += "\r\nContent-Length: " + std::to_string(r.body.size()) + "\r\nConnection: close\r\n\r\n";
    return text + r.body;
}

HttpResponse plain(int status, const std::string& words) {
    return {.status = status, .body = words + "\n", .type = "text/plain"};
}

}  // namespace

/// Reads a request, writes the response, then waits until the client closes: closing first, with bytes of the
/// request unread, would reset the connection and could take the response away from the client.
class HttpServer::Connection {
public:
    Connection(Descriptor fd, std::string client)
        : fd_(std::move(fd)), client_(std::move(client)), until_ns_(monotonic_ns() + kExchange_ns) {}

    [[nodiscard]] pollfd wanted() const noexcept {
        return {fd_.get(), static_cast<short>(out_.empty() ? POLLIN : POLLOUT), 0};
    }
    [[nodiscard]] std::int64_t until_ns() const noexcept { return until_ns_; }

    /// False: the connection has ended.
    bool proceed(short ready, const HttpHandler& handler) {
        if (monotonic_ns() >= until_ns_) {
            if (!answered_) {
                out_ = bytes_of(plain(408, "the request took too long"));
                write_some();
            }
            return false;
        }
        if (ready == 0) return true;
        return out_.empty() ? read_some(handler) : write_some();
    }

private:
    bool read_some(const HttpHandler& handler) {
        std::array<char, 4096> bytes;
        const ssize_t n = ::recv(fd_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
        if (n < 0) return errno == EAGAIN || errno == EINTR;
        if (n == 0) return false;
        if (answered_) return true;
        switch (reader_.take({bytes.data(), static_cast<std::size_t>(n)})) {
            case HttpRequestReader::State::more:
                if (reader_.wants_continue()) out_ = "HTTP/1.1 100 Continue\r\n\r\n";
                return true;
            case HttpRequestReader::State::refused: return answer(plain(reader_.status(), reader_.reason()));
            case HttpRequestReader::State::complete: break;
        }
        HttpRequest request = reader_.request();
        request.client = client_;
        try {
            return answer(handler(request));
        } catch (const std::exception& e) {
            return answer(plain(500, e.what()));
        }
    }

    bool answer(const HttpResponse& response) {
        answered_ = true;
        out_ = bytes_of(response);
        return write_some();
    }

    bool write_some() {
        const ssize_t n = ::send(fd_.get(), out_.data(), out_.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
        if (n < 0) return errno == EAGAIN || errno == EINTR;
        out_.erase(0, static_cast<std::size_t>(n));
        if (out_.empty() && answered_) ::shutdown(fd_.get(), SHUT_WR);
        return true;
    }

    Descriptor fd_;
    std::string client_;
    std::int64_t until_ns_;
    HttpRequestReader reader_;
    std::string out_;
    bool answered_ = false;
};

Result<std::unique_ptr<HttpServer>> HttpServer::start(const std::string& address, std::uint16_t port,
                                                      HttpHandler handler) {
    auto listener = listen_tcp(address, port);
    if (!listener) return listener.error();
    Descriptor end(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!end) return Error{.what = std::string("eventfd: ") + std::strerror(errno), .kind = ErrorKind::missing};
    return std::unique_ptr<HttpServer>(new HttpServer(std::move(listener->fd), std::move(end), std::move(handler)));
}

HttpServer::HttpServer(Descriptor listening, Descriptor end, HttpHandler handler)
    : listening_(std::move(listening)), end_(std::move(end)), handler_(std::move(handler)) {
    connections_.reserve(kConnections);
    thread_ = start_without_signals([this] { run(); });
}

HttpServer::~HttpServer() {
    ::eventfd_write(end_.get(), 1);
    thread_.join();
}

void HttpServer::run() noexcept {
    for (;;) {
        std::array<pollfd, 2 + kConnections> fds;
        const bool full = connections_.size() == kConnections;
        fds[0] = {end_.get(), POLLIN, 0};
        fds[1] = {full ? -1 : listening_.get(), POLLIN, 0};
        std::int64_t until_ns = monotonic_ns() + kExchange_ns;
        for (std::size_t i = 0; i < connections_.size(); ++i) {
            fds[2 + i] = connections_[i].wanted();
            until_ns = std::min(until_ns, connections_[i].until_ns());
        }
        const std::size_t watched = 2 + connections_.size();
        wait_ready(std::span(fds).first(watched), std::max<std::int64_t>(0, until_ns - monotonic_ns()));
        if (fds[0].revents != 0) return;
        try {
            for (std::size_t i = connections_.size(); i-- > 0;)
                if (!connections_[i].proceed(fds[2 + i].revents, handler_))
                    connections_.erase(connections_.begin() + static_cast<std::ptrdiff_t>(i));
            if (fds[1].revents != 0) accept_one();
        } catch (const std::exception&) {  // out of memory: clients try again
            connections_.clear();
        }
    }
}

void HttpServer::accept_one() {
    sockaddr_in from{};
    socklen_t size = sizeof from;
    Descriptor fd(
        ::accept4(listening_.get(), reinterpret_cast<sockaddr*>(&from), &size, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!fd) {  // no descriptor left: pause before the next accept
        if (errno == EMFILE || errno == ENFILE) wait_ready(std::span<pollfd>(), kExchange_ns / 50);
        return;
    }
    std::array<char, INET_ADDRSTRLEN> text{};
    ::inet_ntop(AF_INET, &from.sin_addr, text.data(), text.size());
    connections_.emplace_back(std::move(fd), text.data());
}

}  // namespace narpa
