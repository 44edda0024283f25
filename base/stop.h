/// base/stop.h - the request to stop, set by signals and checked by every wait.
#pragma once

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdint>

#include "base/time.h"

namespace narpa {

using StopFlag = std::atomic<bool>;

/// The program's flag, set by SIGINT, SIGTERM and SIGHUP.
inline StopFlag& stop_flag() noexcept {
    static StopFlag flag{false};
    return flag;
}

/// SIGINT, SIGTERM and SIGHUP (unless it is ignored, as under nohup(1)) set the flag; another one after two seconds
/// or more exits at once with status 130. (timeout(1) and others signal a process and then its process group: that
/// is one request. Real-time threads may delay the second signal by nearly two seconds.)
inline void stop_on_signals() noexcept {
    struct sigaction action {};
    action.sa_handler = [](int) {
        static std::atomic<std::int64_t> first_ns{0};
        const std::int64_t now_ns = monotonic_ns();
        std::int64_t before_ns = 0;
        if (first_ns.compare_exchange_strong(before_ns, now_ns))
            stop_flag() = true;
        else if (now_ns - before_ns >= 2 * kSecond_ns)
            ::_exit(130);
    };
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    struct sigaction hang_up {};
    if (::sigaction(SIGHUP, nullptr, &hang_up) == 0 && hang_up.sa_handler != SIG_IGN)
        ::sigaction(SIGHUP, &action, nullptr);
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;  // writing to a closed FIFO or socket returns an error code instead
    ::sigaction(SIGPIPE, &ignore, nullptr);
}

}  // namespace narpa
