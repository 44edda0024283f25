/// drivers/tcp_listener.h - a TCP socket that listens at an address of this machine.
#pragma once

#include <cstdint>
#include <string>

#include "base/result.h"
#include "drivers/descriptor.h"

namespace narpa {

struct TcpListener {
    Descriptor fd;           ///< accepts without blocking
    std::uint16_t port = 0;  ///< as requested; for 0, the free one that the kernel chose
};
/// `address`: IPv4. Errors: no such address, or one that cannot be bound.
[[nodiscard]] Result<TcpListener> listen_tcp(const std::string& address, std::uint16_t port);

}  // namespace narpa
