#include "emulator/realtime.h"

#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

#include <csignal>

#include "emulator/stop.h"

namespace narpa {

bool lock_memory() noexcept {
    return ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

bool take_fifo_priority(int priority) noexcept {
    sched_param parameters{};
    parameters.sched_priority = priority;
    return ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters) == 0;
}

void name_thread(const char* name) noexcept {
    ::pthread_setname_np(::pthread_self(), name);
}

void stop_on_signals() noexcept {
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
