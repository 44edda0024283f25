#include "drivers/datagram.h"

#include <cerrno>
#include <cstring>

#include "drivers/descriptor.h"

namespace narpa {
namespace {

/// The kernel stamps with CLOCK_REALTIME; the age of the stamp converts it to CLOCK_MONOTONIC. An impossible age
/// (the wall clock was set meanwhile) counts as 0.
std::int64_t to_monotonic(const timespec& stamp) noexcept {
    constexpr std::int64_t max_age_ns = 10 * kSecond_ns;
    const std::int64_t age_ns = clock_ns(CLOCK_REALTIME) - (stamp.tv_sec * kSecond_ns + stamp.tv_nsec);
    return monotonic_ns() - (age_ns >= 0 && age_ns <= max_age_ns ? age_ns : 0);
}

}  // namespace

void prepare_for_bursts(int fd) noexcept {
    const int bytes = 4 << 20, on = 1;
    // Only root may exceed net.core.rmem_max; others get at most that.
    if (::setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0)
        ::setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    ::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &on, sizeof on);
}

Datagram receive_datagram(int fd, std::span<std::uint8_t> buffer, sockaddr* source,
                          socklen_t source_bytes) noexcept {
    alignas(cmsghdr) char control[CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))];
    iovec part{buffer.data(), buffer.size()};
    msghdr message{};
    message.msg_name = source;
    message.msg_namelen = source_bytes;
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;

    Datagram d;
    do {
        d.bytes = ::recvmsg(fd, &message, MSG_DONTWAIT);
    } while (d.bytes < 0 && errno == EINTR);
    if (d.bytes < 0) return d;
    d.truncated = (message.msg_flags & MSG_TRUNC) != 0;
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
        if (c->cmsg_level != SOL_SOCKET) continue;
        if (c->cmsg_type == SCM_TIMESTAMPNS) {
            timespec stamp{};
            std::memcpy(&stamp, CMSG_DATA(c), sizeof stamp);
            d.t_received_ns = to_monotonic(stamp);
        } else if (c->cmsg_type == SO_RXQ_OVFL) {
            std::memcpy(&d.lost, CMSG_DATA(c), sizeof d.lost);
        }
    }
    if (d.t_received_ns == 0) d.t_received_ns = monotonic_ns();
    return d;
}

bool send_datagram(int fd, std::span<const std::uint8_t> bytes, const sockaddr* to, socklen_t to_bytes) noexcept {
    ssize_t n = 0;
    do {
        n = ::sendto(fd, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL, to, to_bytes);
    } while (n < 0 && errno == EINTR);
    return n == static_cast<ssize_t>(bytes.size());
}

}  // namespace narpa
