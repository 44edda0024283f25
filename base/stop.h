/// base/stop.h - the one request to end, set by signals and looked at by every wait.
#pragma once

#include <unistd.h>

#include <atomic>
#include <csignal>

namespace narpa {

using StopFlag = std::atomic<bool>;

/// The program's flag: what SIGINT and SIGTERM set.
inline StopFlag& stop_flag() noexcept {
    static StopFlag flag{false};
    return flag;
}

/// SIGINT and SIGTERM set the flag once; a second one ends the program at once.
inline void stop_on_signals() noexcept {
    struct sigaction action {};
    action.sa_handler = [](int) {
        if (stop_flag().exchange(true)) ::_exit(130);
    };
    ::sigaction(SIGINT, &action, nullptr);
    ::sigaction(SIGTERM, &action, nullptr);
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;  // a reader that leaves a FIFO or a socket is an error code, not a death
    ::sigaction(SIGPIPE, &ignore, nullptr);
}

}  // namespace narpa
