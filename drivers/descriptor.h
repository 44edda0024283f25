/// drivers/descriptor.h - a file descriptor that closes itself, and waiting on some of them.
#pragma once

#include <poll.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include "base/time.h"

namespace narpa {

class Descriptor {
public:
    Descriptor() = default;
    explicit Descriptor(int fd) noexcept : fd_(fd) {}
    Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
    Descriptor& operator=(Descriptor&& other) noexcept {
        if (this != &other) {
            reset();
            fd_ = std::exchange(other.fd_, -1);
        }
        return *this;
    }
    ~Descriptor() { reset(); }

    void reset() noexcept {
        if (fd_ >= 0) ::close(fd_);
        fd_ = -1;
    }
    [[nodiscard]] int get() const noexcept { return fd_; }
    explicit operator bool() const noexcept { return fd_ >= 0; }

private:
    int fd_ = -1;
};

/// Waits until one is ready or the time is over; -1 waits for ever. A negative fd is skipped.
inline void wait_ready(std::span<pollfd> fds, std::int64_t timeout_ns) noexcept {
    const timespec t{timeout_ns / kSecond_ns, timeout_ns % kSecond_ns};
    ::ppoll(fds.data(), fds.size(), timeout_ns < 0 ? nullptr : &t, nullptr);
}

/// True at most once a second: when to retry a device that has gone away.
class RetryTimer {
public:
    [[nodiscard]] bool due() noexcept {
        const std::int64_t now = monotonic_ns();
        if (now < next_ns_) return false;
        next_ns_ = now + kSecond_ns;
        return true;
    }
    /// `timeout_ns`, but no later than the next try.
    [[nodiscard]] std::int64_t limit(std::int64_t timeout_ns) const noexcept {
        const std::int64_t left = std::max<std::int64_t>(next_ns_ - monotonic_ns(), 0);
        return timeout_ns < 0 ? left : std::min(timeout_ns, left);
    }

private:
    std::int64_t next_ns_ = 0;
};

}  // namespace narpa
