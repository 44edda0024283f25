#include "rehearsal/runner/free_port.h"

#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "protocols/lidar/lidar_model.h"

namespace narpa::rehearsal {
namespace {

/// The largest data port from which every make's position port is still in range.
int last_data_port() {
    int offset = 0;
    for (const LidarMake* make : lidar_makes()) offset = std::max(offset, make->network.position_port_offset());
    return 65535 - offset;
}

/// Binds to any free port; returns -1 if there is none.
int bind_any(int fd) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    const bool good = fd >= 0 && ::bind(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
                      ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    return good ? ntohs(address.sin_port) : -1;
}

}  // namespace

Result<int> free_lidar_port() {
    constexpr int kTries = 200;
    const int last = last_data_port();
    std::vector<int> held;  // ports that are too high stay occupied while others are tried
    int port = 0;
    for (int k = 0; k < kTries; ++k) {
        held.push_back(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
        port = bind_any(held.back());
        if (port <= last) break;
    }
    const int reason = errno;
    for (const int fd : held)
        if (fd >= 0) ::close(fd);
    if (port < 0)
        return Error{fmt::format("no UDP port on the loopback: {}", std::strerror(reason)), "", 0, 0,
                     ErrorKind::missing};
    if (port > last)
        return Error{fmt::format("no free UDP port up to {} on the loopback", last), "", 0, 0, ErrorKind::missing};
    return port;
}

}  // namespace narpa::rehearsal
