#include "drivers/udp_listener.h"

#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>

#include "base/text/read_number.h"
#include "drivers/datagram.h"
#include "drivers/udp_route.h"

namespace narpa {
namespace {

Result<UdpDestination> address_of(const std::string& node, const std::string& port, const std::string& what) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    hints.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
    if (const int failure = ::getaddrinfo(node.c_str(), port.c_str(), &hints, &found); failure != 0)
        return Error{what + ": \"" + node + "\" is not an address: " + ::gai_strerror(failure)};
    UdpDestination at;
    std::memcpy(&at.address, found->ai_addr, found->ai_addrlen);
    at.size = found->ai_addrlen;
    ::freeaddrinfo(found);
    return at;
}

Error cannot_listen(const std::string& what, const std::string& port, int reason) {
    Error error{what + ": cannot listen: " + std::strerror(reason), {}, 0, 0, ErrorKind::missing};
    if (reason == EADDRINUSE) error.remedy = "another port, or see who has it: ss -lunp 'sport = :" + port + "'";
    if (reason == EADDRNOTAVAIL) error.remedy = "ip -br address   (the addresses of this machine)";
    return error;
}

}  // namespace

Result<UdpListener> listen_udp(std::string_view text, const std::string& what, std::string_view scheme) {
    auto address = UdpAddress::parse(text, {}, scheme);
    if (!address) return address.error();
    const std::string& port = address->port;
    if (text.find(':') == text.npos) address->host = "0.0.0.0";
    std::uint16_t number = 0;
    if (address->host.empty() || address->ttl >= 0 || !read_number(port, number) || number == 0)
        return Error{what + ": expected " + address->scheme + ":PORT or " + address->scheme +
                     ":ADDRESS:PORT with a port from 1 to 65535, as in " + address->scheme + ":2368"};

    // A link-local IPv6 address is complete only with its interface.
    const bool ipv6 = address->host.find(':') != std::string::npos;
    const std::string node = address->host + (ipv6 && !address->interface.empty() ? "%" + address->interface : "");
    const auto at = address_of(node, port, what);
    if (!at) return at.error();
    if (!ipv6 && !address->interface.empty() && !at->is_multicast())
        return Error{what + ": an interface is named to join a multicast group, and " + address->host + " is none"};
    Descriptor fd(::socket(at->address.ss_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    const int on = 1;  // a group has any number of receivers
    if (fd && at->is_multicast()) ::setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    if (!fd || ::bind(fd.get(), reinterpret_cast<const sockaddr*>(&at->address), at->size) != 0)
        return cannot_listen(what, port, errno);
    if (auto joined = join_group(fd.get(), *at, *address, what); !joined) return joined.error();
    prepare_for_bursts(fd.get());
    return UdpListener{std::move(fd), address->host, port};
}

}  // namespace narpa
