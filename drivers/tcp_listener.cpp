#include "drivers/tcp_listener.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "base/text/read_number.h"

namespace narpa {

Result<TcpListener> listen_tcp(const std::string& address, std::uint16_t port) {
    constexpr int kWaiting = 16;
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(port);
    if (::inet_pton(AF_INET, address.c_str(), &at.sin_addr) != 1)
        return Error{"\"" + address + "\": expected an IPv4 address of this machine to listen at"};
    Descriptor fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
    const int on = 1;
    auto* const raw = reinterpret_cast<sockaddr*>(&at);
    socklen_t size = sizeof at;
    if (!fd || ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
        ::bind(fd.get(), raw, size) != 0 || ::listen(fd.get(), kWaiting) != 0 ||
        ::getsockname(fd.get(), raw, &size) != 0)
        return Error{
            .what = "cannot listen at " + address + ":" + std::to_string(port) + ": " + std::strerror(errno),
            .kind = ErrorKind::missing};
    return TcpListener{std::move(fd), ntohs(at.sin_port)};
}

Result<ListenAddress> parse_listen_address(std::string_view text) {
    ListenAddress at;
    const std::size_t colon = text.rfind(':');
    if (colon != std::string_view::npos) at.host = text.substr(0, colon);
    in_addr unused{};
    if (!read_number(text.substr(colon == std::string_view::npos ? 0 : colon + 1), at.port) ||
        ::inet_pton(AF_INET, at.host.c_str(), &unused) != 1)
        return Error{"\"" + std::string(text) + "\": expected [ADDRESS:]PORT, such as 3240 or 0.0.0.0:3240"};
    return at;
}

std::string to_string(const ListenAddress& at) {
    return at.host + ":" + std::to_string(at.port);
}

bool is_loopback(const ListenAddress& at) {
    return at.host.starts_with("127.");
}

}  // namespace narpa
