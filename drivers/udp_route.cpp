#include "drivers/udp_route.h"

#include <arpa/inet.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <span>

#include "base/text/read_number.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

const sockaddr_in& as_ipv4(const sockaddr_storage& a) {
    return reinterpret_cast<const sockaddr_in&>(a);
}
const sockaddr_in6& as_ipv6(const sockaddr_storage& a) {
    return reinterpret_cast<const sockaddr_in6&>(a);
}

Error missing(const std::string& what, const std::string& remedy) {
    return {.what = what, .kind = ErrorKind::missing, .remedy = remedy};
}

/// Index of the interface; 0: none is named.
Result<unsigned> interface_index(const UdpAddress& address, const std::string& what) {
    if (address.interface.empty()) return 0u;
    const unsigned index = ::if_nametoindex(address.interface.c_str());
    if (index == 0)
        return missing(what + ": there is no network interface \"" + address.interface + "\"",
                       "ip -br link   (the interfaces of this machine)");
    return index;
}

template <class T>
bool set(int fd, int level, int option, const T& value) {
    return ::setsockopt(fd, level, option, &value, sizeof value) == 0;
}

bool set_interface(int fd, UdpDestination& to, unsigned index) {
    if (to.address.ss_family == AF_INET6) {
        reinterpret_cast<sockaddr_in6&>(to.address).sin6_scope_id = index;
        return to.is_multicast() ? set(fd, IPPROTO_IPV6, IPV6_MULTICAST_IF, index)
                                 : set(fd, IPPROTO_IPV6, IPV6_UNICAST_IF, htonl(index));
    }
    ip_mreqn interface {};
    interface.imr_ifindex = static_cast<int>(index);
    return to.is_multicast() ? set(fd, IPPROTO_IP, IP_MULTICAST_IF, interface)
                             : set(fd, IPPROTO_IP, IP_UNICAST_IF, htonl(index));
}

bool set_ttl(int fd, const UdpDestination& to, int ttl) {
    if (to.address.ss_family == AF_INET6)
        return set(fd, IPPROTO_IPV6, to.is_multicast() ? IPV6_MULTICAST_HOPS : IPV6_UNICAST_HOPS, ttl);
    return set(fd, IPPROTO_IP, to.is_multicast() ? IP_MULTICAST_TTL : IP_TTL, ttl);
}

/// True if the kernel has a route. Connecting a UDP socket sends nothing.
bool has_route(const UdpDestination& to) {
    const Descriptor fd(::socket(to.address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    UdpDestination with_port = to;
    with_port.set_port(9);
    const int on = 1;
    set(fd.get(), SOL_SOCKET, SO_BROADCAST, on);
    return ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&with_port.address), with_port.size) == 0 ||
           errno != ENETUNREACH;
}

/// Reads "NAME=N,NAME=FILE".
Status read_options(std::string_view text, std::span<const UdpOption> options) {
    for (bool more = true; more;) {
        const std::string_view option = text.substr(0, text.find(','));
        more = option.size() < text.size();
        text = text.substr(std::min(option.size() + 1, text.size()));
        const std::size_t equals = std::min(option.find('='), option.size());
        const auto known = std::ranges::find(options, option.substr(0, equals), &UdpOption::name);
        const std::string_view given = option.substr(std::min(equals + 1, option.size()));
        if (known != options.end() && known->file != nullptr && !given.empty()) {
            *known->file = given;
            continue;
        }
        int value = 0;
        if (known != options.end() && known->file == nullptr && read_number(given, value) &&
            value >= known->least && value <= known->most) {
            *known->value = value;
            continue;
        }
        std::string expected;
        for (const UdpOption& o : options)
            expected.append(expected.empty() ? "," : " or ,")
                .append(o.name)
                .append(o.file != nullptr
                            ? "=FILE"
                            : "=N, from " + std::to_string(o.least) + " to " + std::to_string(o.most));
        return Error{"expected nothing after the port but " + expected};
    }
    return Ok{};
}

bool is_limited_broadcast(const UdpDestination& to) {
    return to.address.ss_family == AF_INET && as_ipv4(to.address).sin_addr.s_addr == INADDR_BROADCAST;
}

}  // namespace

Result<UdpAddress> UdpAddress::parse(std::string_view text, std::vector<UdpOption> options,
                                     std::string_view scheme) {
    UdpAddress out;
    out.scheme = scheme;
    const std::string whole = out.scheme + ":" + std::string(text);
    options.insert(options.begin(), {"ttl", 0, 255, &out.ttl});
    if (const std::size_t comma = text.find(','); comma != text.npos) {
        if (auto read = read_options(text.substr(comma + 1), options); !read)
            return Error{whole + ": " + read.error().what};
        text = text.substr(0, comma);
    }
    const std::size_t colon = text.rfind(':');
    out.port = text.substr(colon == text.npos ? 0 : colon + 1);
    if (colon == text.npos) return out;
    std::string_view host = text.substr(0, colon);
    if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
    const std::size_t percent = host.find('%');
    out.host = host.substr(0, percent);
    if (percent == host.npos) return out;
    out.interface = host.substr(percent + 1);
    if (out.interface.empty()) return Error{whole + ": expected an interface after %, as in %eth0"};
    return out;
}

Result<UdpDestination> UdpDestination::resolve(const std::string& host, const std::string& what) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    if (const int error = ::getaddrinfo(host.c_str(), nullptr, &hints, &found); error != 0)
        return Error{what + ": unknown host \"" + host + "\": " + ::gai_strerror(error)};
    const addrinfo* best = found;
    for (const addrinfo* a = found; a != nullptr && best->ai_family != AF_INET; a = a->ai_next)
        if (a->ai_family == AF_INET) best = a;
    UdpDestination destination;
    std::memcpy(&destination.address, best->ai_addr, best->ai_addrlen);
    destination.size = best->ai_addrlen;
    ::freeaddrinfo(found);
    return destination;
}

std::string UdpDestination::text() const {
    std::array<char, INET6_ADDRSTRLEN> text{};
    const void* bytes = address.ss_family == AF_INET6 ? static_cast<const void*>(&as_ipv6(address).sin6_addr)
                                                      : &as_ipv4(address).sin_addr;
    return ::inet_ntop(address.ss_family, bytes, text.data(), text.size());
}

void UdpDestination::set_port(int port) noexcept {
    const in_port_t wire = htons(static_cast<std::uint16_t>(port));
    if (address.ss_family == AF_INET6)
        reinterpret_cast<sockaddr_in6&>(address).sin6_port = wire;
    else
        reinterpret_cast<sockaddr_in&>(address).sin_port = wire;
}

bool UdpDestination::is_multicast() const noexcept {
    if (address.ss_family == AF_INET6) return IN6_IS_ADDR_MULTICAST(&as_ipv6(address).sin6_addr);
    return IN_MULTICAST(ntohl(as_ipv4(address).sin_addr.s_addr));
}

Status set_route(int fd, UdpDestination& to, const UdpAddress& address, const std::string& what) {
    const auto index = interface_index(address, what);
    if (!index) return index.error();
    const int on = 1;
    set(fd, SOL_SOCKET, SO_BROADCAST, on);
    if (*index != 0 && !set_interface(fd, to, *index))
        return missing(what + ": the interface \"" + address.interface + "\" is not taken: " + std::strerror(errno),
                       "ip -br address   (interfaces and their addresses)");
    if (address.ttl >= 0 && !set_ttl(fd, to, address.ttl))
        return Error{what + ": ttl=" + std::to_string(address.ttl) + ": " + std::strerror(errno) +
                     ", expected 1 to 255, or 0 to 255 to a multicast group"};
    if (*index == 0 && (to.is_multicast() || is_limited_broadcast(to)) && !has_route(to))
        return missing(what + ": this machine has no route there: name the interface to send by, as in " +
                           address.scheme + ":" + address.host + "%eth0:" + address.port,
                       "ip -br link   (the interfaces of this machine)");
    return Ok{};
}

Status join_group(int fd, const UdpDestination& group, const UdpAddress& address, const std::string& what) {
    if (!group.is_multicast()) return Ok{};
    const auto index = interface_index(address, what);
    if (!index) return index.error();
    bool joined = false;
    if (group.address.ss_family == AF_INET6) {
        joined = set(fd, IPPROTO_IPV6, IPV6_JOIN_GROUP, ipv6_mreq{as_ipv6(group.address).sin6_addr, *index});
    } else {
        ip_mreqn membership{};
        membership.imr_multiaddr = as_ipv4(group.address).sin_addr;
        membership.imr_ifindex = static_cast<int>(*index);
        joined = set(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership);
    }
    if (joined) return Ok{};
    return missing(what + ": cannot join the multicast group " + address.host + ": " + std::strerror(errno),
                   "name the interface, as in " + address.scheme + ":" + address.host + "%eth0:" + address.port +
                       "; ip -br link shows them");
}

}  // namespace narpa
