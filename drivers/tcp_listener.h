/// drivers/tcp_listener.h - TCP sockets that listen at an address of this machine.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/result.h"
#include "drivers/descriptor.h"

namespace narpa {

struct TcpListener {
    Descriptor fd;           ///< accepts without blocking
    std::uint16_t port = 0;  ///< as requested; for 0, the free one that the kernel chose
};
/// `address`: IPv4. Errors: no such address, or one that cannot be bound.
[[nodiscard]] Result<TcpListener> listen_tcp(const std::string& address, std::uint16_t port);

/// `[HOST:]PORT` of command lines: HOST is an IPv4 address, loopback where it is absent.
struct ListenAddress {
    std::string host = "127.0.0.1";
    std::uint16_t port = 0;
};
[[nodiscard]] Result<ListenAddress> parse_listen_address(std::string_view text);
/// "ADDRESS:PORT".
[[nodiscard]] std::string to_string(const ListenAddress& at);
/// Only programs of this machine reach it: 127.0.0.0/8.
[[nodiscard]] bool is_loopback(const ListenAddress& at);

}  // namespace narpa
