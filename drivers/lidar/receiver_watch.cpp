#include "drivers/lidar/receiver_watch.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "drivers/background_thread.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

constexpr int kPeriod_ms = 500;

in6_addr mapped(const in_addr& v4) noexcept {
    in6_addr address{};
    address.s6_addr[10] = address.s6_addr[11] = 0xFF;
    std::memcpy(&address.s6_addr[12], &v4, sizeof v4);
    return address;
}

/// The table has an address as words of 32 bits in the machine's byte order: one for IPv4, four for IPv6.
bool parse_address(const char* hex, std::size_t digits, in6_addr& out) noexcept {
    std::array<std::uint32_t, 4> words{};
    if (digits != 8 && digits != 32) return false;
    for (std::size_t i = 0; i < digits / 8; ++i)
        if (std::sscanf(hex + 8 * i, "%8x", &words[i]) != 1) return false;
    if (digits == 8) {
        out = mapped(in_addr{words[0]});
    } else {
        std::memcpy(&out, words.data(), sizeof out);
    }
    return true;
}

bool is_any(const in6_addr& a) noexcept {
    const in6_addr any_v4 = mapped(in_addr{});
    return IN6_IS_ADDR_UNSPECIFIED(&a) || std::memcmp(&a, &any_v4, sizeof a) == 0;
}

/// A socket can be bound to an address of this machine, and to a broadcast or multicast address.
bool reaches_this_machine(sockaddr_storage to) noexcept {
    if (to.ss_family == AF_INET6) {
        reinterpret_cast<sockaddr_in6&>(to).sin6_port = 0;
    } else {
        reinterpret_cast<sockaddr_in&>(to).sin_port = 0;
    }
    const Descriptor fd(::socket(to.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    return fd && ::bind(fd.get(), reinterpret_cast<const sockaddr*>(&to),
                        to.ss_family == AF_INET6 ? sizeof(sockaddr_in6) : sizeof(sockaddr_in)) == 0;
}

}  // namespace

ReceiverWatch::ReceiverWatch(const sockaddr_storage& to, std::array<int, 2> ports) : ports_(ports) {
    if (!reaches_this_machine(to)) return;
    to_ = to.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(to).sin6_addr
                                   : mapped(reinterpret_cast<const sockaddr_in&>(to).sin_addr);
    end_fd_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (end_fd_ < 0) return;
    sockets_.reserve(kSocketsMost);
    update();
    thread_ = start_without_signals([this] { run(); });
}

ReceiverWatch::~ReceiverWatch() {
    if (end_fd_ < 0) return;
    ::eventfd_write(end_fd_, 1);
    if (thread_.joinable()) thread_.join();
    ::close(end_fd_);
}

void ReceiverWatch::run() noexcept {
    pollfd end{end_fd_, POLLIN, 0};
    while (::poll(&end, 1, kPeriod_ms) == 0) update();
}

void ReceiverWatch::update() noexcept {
    if (end_fd_ < 0) return;
    const std::lock_guard one_at_a_time(reading_);
    read_table("/proc/net/udp");
    read_table("/proc/net/udp6");
    first_ = false;
}

void ReceiverWatch::read_table(const char* path) noexcept {
    const Descriptor file(::open(path, O_RDONLY | O_CLOEXEC));
    std::array<char, 4096> text;
    std::size_t held = 0;
    for (ssize_t n = 0; file && (n = ::read(file.get(), text.data() + held, text.size() - 1 - held)) > 0;) {
        held += static_cast<std::size_t>(n);
        char* row = text.data();
        for (char* end; (end = static_cast<char*>(std::memchr(row, '\n', text.data() + held - row)));
             row = end + 1) {
            *end = 0;
            read_row(row);
        }
        held = static_cast<std::size_t>(text.data() + held - row);
        std::memmove(text.data(), row, held);
    }
}

/// Source: Linux, Documentation/networking/proc_net_tcp.rst; the last column of UDP's tables is `drops`.
void ReceiverWatch::read_row(const char* row) noexcept {
    std::array<char, 33> hex{};
    unsigned port = 0;
    unsigned long inode = 0;
    Socket found;
    in6_addr bound{};
    if (std::sscanf(row, " %*d: %32[0-9A-Fa-f]:%x %*s %*s %*s %*s %*s %*s %*s %lu %*s %*s %u", hex.data(), &port,
                    &inode, &found.drops) != 4)
        return;
    if (port == 0 || std::ranges::find(ports_, static_cast<int>(port)) == ports_.end()) return;
    if (!parse_address(hex.data(), std::strlen(hex.data()), bound)) return;
    if (!is_any(bound) && std::memcmp(&bound, &to_, sizeof to_) != 0) return;
    found.inode = inode;
    const auto at = std::ranges::find(sockets_, found.inode, &Socket::inode);
    if (at != sockets_.end()) {
        dropped_ += found.drops - at->drops;
        at->drops = found.drops;
    } else if (sockets_.size() < kSocketsMost) {
        sockets_.push_back(found);
        if (!first_) dropped_ += found.drops;
    }
}

}  // namespace narpa
