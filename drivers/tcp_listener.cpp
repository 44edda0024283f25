#include "drivers/tcp_listener.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <utility>

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

}  // namespace narpa
