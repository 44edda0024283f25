/// drivers/udp_route.h - where UDP datagrams go and how they leave this machine: address, interface, time to
/// live.
///
/// Text: HOST[%INTERFACE]:PORT[,ttl=N], an IPv6 host in brackets (RFC 4007 writes the interface in the same way).
/// A sink may take further options of this form.
/// Broadcast and multicast addresses need an entry in the routing table, which often has none, or a named
/// interface.
#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace narpa {

/// An option behind an address: NAME=N, or NAME=FILE.
struct UdpOption {
    std::string_view name;
    int least, most;
    int* value;                   ///< out; unchanged where the option is not given
    std::string* file = nullptr;  ///< the same, in place of a number: no comma is in it
};

/// The parts of an address text; they may be empty.
struct UdpAddress {
    std::string host, interface, port;
    int ttl = -1;                ///< 0 to 255; -1: the system's, 1 for multicast
    std::string scheme = "udp";  ///< what stands before the colon, for error texts

    /// Errors concern the options, `ttl` and these; host and port are not checked.
    static Result<UdpAddress> parse(std::string_view text, std::vector<UdpOption> options = {},
                                    std::string_view scheme = "udp");
};

/// An address with its family; the port is 0.
struct UdpDestination {
    sockaddr_storage address{};
    socklen_t size = 0;

    /// Resolves the host. A name with addresses of both families gives an IPv4 one, because most LiDAR drivers
    /// listen only there. `what`: start of the error texts.
    static Result<UdpDestination> resolve(const std::string& host, const std::string& what);
    /// "192.168.1.70", without interface and port.
    [[nodiscard]] std::string text() const;
    void set_port(int port) noexcept;
    [[nodiscard]] bool is_multicast() const noexcept;
};

/// Sets interface and time to live of a socket of the destination's family, and allows broadcasts, which the
/// instrument sends too. Errors: no such interface; no interface named and no route to a multicast address or to
/// the limited broadcast address, 255.255.255.255.
[[nodiscard]] Status set_route(int fd, UdpDestination& to, const UdpAddress& address, const std::string& what);

/// Makes a bound socket a receiver of a multicast group; does nothing for other addresses.
[[nodiscard]] Status join_group(int fd, const UdpDestination& group, const UdpAddress& address,
                                const std::string& what);

}  // namespace narpa
