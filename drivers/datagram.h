/// drivers/datagram.h - one datagram: sent, or read with the time of its arrival and the kernel's
/// count of lost ones.
#pragma once

#include <sys/socket.h>

#include <cstdint>
#include <span>
#include <utility>

namespace narpa {

/// At least 4 MiB of receive buffer (the default holds 278 classic CAN frames: 35 ms of a full 1 Mbit/s bus),
/// arrival stamps and loss counts.
void prepare_for_bursts(int fd) noexcept;

struct Datagram {
    long bytes = -1;  ///< as recvmsg: -1 with errno when there is none
    bool truncated = false;
    std::int64_t t_received_ns = 0;  ///< CLOCK_MONOTONIC
    std::uint32_t lost = 0;          ///< datagrams dropped by the kernel so far (SO_RXQ_OVFL); 0: no count
};

/// Computes increases of Datagram::lost, a 32-bit count that wraps.
class LossCount {
public:
    [[nodiscard]] std::uint32_t increase_to(std::uint32_t lost) noexcept {
        return lost == 0 ? 0 : lost - std::exchange(last_, lost);
    }

private:
    std::uint32_t last_ = 0;
};

/// Does not wait. `source`, where given, gets the sender's address.
[[nodiscard]] Datagram receive_datagram(int fd, std::span<std::uint8_t> buffer, sockaddr* source = nullptr,
                                        socklen_t source_bytes = 0) noexcept;

/// Does not wait; true: the whole datagram was sent.
[[nodiscard]] bool send_datagram(int fd, std::span<const std::uint8_t> bytes, const sockaddr* to,
                                 socklen_t to_bytes) noexcept;

}  // namespace narpa
