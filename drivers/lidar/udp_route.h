/// drivers/lidar/udp_route.h - where UDP datagrams go and how they leave this machine: address, interface, time to
/// live.
///
/// Text: HOST[%INTERFACE]:PORT[,ttl=N], an IPv6 host in brackets (RFC 4007 writes the interface in the same way).
/// Broadcast and multicast addresses name many receivers and no way to them: the system sends them where its table
/// of routes says, which often has none; an interface decides.
#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>

#include "base/result.h"

namespace narpa {

/// A text in its parts; they may be empty.
struct UdpAddress {
    std::string host, interface, port;
    int ttl = -1;  ///< 0 to 255; -1: the system's, 1 for multicast

    /// An Error names what is wrong with the options; hosts and ports are not looked at.
    static Result<UdpAddress> parse(std::string_view text);
};

/// An address with its family; the port is 0.
struct UdpDestination {
    sockaddr_storage address{};
    socklen_t size = 0;

    /// Looks the host up. Of a name with addresses of both families it is an IPv4 one: most drivers of LiDARs
    /// listen there alone. `what` begins its Errors.
    static Result<UdpDestination> resolve(const std::string& host, const std::string& what);
    /// "192.168.1.70", without interface and port.
    [[nodiscard]] std::string text() const;
    void set_port(int port) noexcept;
    [[nodiscard]] bool is_multicast() const noexcept;
};

/// Sets a socket of the destination's family for it: broadcasts are allowed, as by the instrument. Errors: there is
/// no such interface, and no route to a multicast or to the limited broadcast address, 255.255.255.255, where the
/// interface is not named.
[[nodiscard]] Status set_route(int fd, UdpDestination& to, const UdpAddress& address, const std::string& what);

/// Makes a bound socket a receiver of a multicast group; does nothing for other addresses.
[[nodiscard]] Status join_group(int fd, const UdpDestination& group, const UdpAddress& address,
                                const std::string& what);

}  // namespace narpa
