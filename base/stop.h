/// base/stop.h - the one request to end, set by signals and looked at by every wait.
#pragma once

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>
#include <ctime>

namespace narpa {

using StopFlag = std::atomic<bool>;

/// The program's flag: what SIGINT and SIGTERM set.
inline StopFlag& stop_flag() noexcept {
    static StopFlag flag{false};
    return flag;
}

/// SIGINT and SIGTERM set the flag; one more after two seconds or longer ends the program at once, with status 130.
/// (timeout(1) and others signal a process and then its group, which it is in: that is one request, not two.
/// Between the two, real-time threads may keep such a sender from its processor for the better part of two
/// seconds.)
inline void stop_on_signals() noexcept {
    struct sigaction action {};
    action.sa_handler = [](int) {
        static std::atomic<std::int64_t> first_ns{0};
        timespec now{};
        ::clock_gettime(CLOCK_MONOTONIC, &now);
        const std::int64_t now_ns = std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
        std::int64_t before_ns = 0;
        if (first_ns.compare_exchange_strong(before_ns, now_ns))
            stop_flag() = true;
        else if (now_ns - before_ns >= 2'000'000'000)
            ::_exit(130);
    };
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;  // a reader that leaves a FIFO or a socket is an error code, not a death
    ::sigaction(SIGPIPE, &ignore, nullptr);
}

}  // namespace narpa
