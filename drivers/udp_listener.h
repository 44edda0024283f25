/// drivers/udp_listener.h - UDP sockets that receive at an address of this machine.
#pragma once

#include <string>
#include <string_view>

#include "base/result.h"
#include "drivers/descriptor.h"

namespace narpa {

struct UdpListener {
    Descriptor fd;  ///< does not block; has a large buffer, arrival stamps and loss counts (drivers/datagram.h)
    std::string host, port;
};
/// `text`: [ADDRESS[%INTERFACE]:]PORT; without an address, any IPv4 one. A multicast group is joined. `what`: start
/// of the error texts; `scheme`: what stands before the text.
[[nodiscard]] Result<UdpListener> listen_udp(std::string_view text, const std::string& what,
                                             std::string_view scheme = "udp");

}  // namespace narpa
