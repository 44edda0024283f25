/// drivers/lidar/receiver_watch.h - datagrams that receivers on this machine lose because their socket's buffer is
/// full.
///
/// The kernel drops such a datagram without notice to the sender and counts it at the receiving socket, in
/// /proc/net/udp and /proc/net/udp6. A thread of normal priority reads the counts twice a second.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

namespace narpa {

class ReceiverWatch {
public:
    /// Watches sockets bound to one of these ports (0: none), at this address or at the wildcard address.
    ReceiverWatch(const sockaddr_storage& to, std::array<int, 2> ports);
    ~ReceiverWatch();
    ReceiverWatch(const ReceiverWatch&) = delete;
    ReceiverWatch& operator=(const ReceiverWatch&) = delete;

    /// Reads the counts now.
    void update() noexcept;
    /// Since construction, as last read.
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

private:
    /// Few sockets share a port (SO_REUSEPORT, multicast); sockets beyond this number are not counted.
    static constexpr std::size_t kSocketsMost = 4096;

    struct Socket {
        std::uint64_t inode = 0;
        std::uint32_t drops = 0;  ///< as the kernel counts them, modulo 2^32
    };
    void read_table(const char* path) noexcept;
    void read_row(const char* row) noexcept;
    void run() noexcept;

    in6_addr to_{};  ///< IPv4 addresses mapped into IPv6
    std::array<int, 2> ports_;
    std::vector<Socket> sockets_;  ///< those known; room for kSocketsMost is taken at the start
    bool first_ = true;            ///< the first reading is the baseline: its counts are of earlier datagrams
    std::mutex reading_;
    std::atomic<std::uint64_t> dropped_{0};
    int end_fd_ = -1;
    std::thread thread_{};
};

}  // namespace narpa
