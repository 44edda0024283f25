/// base/fifo_priority.h - real-time priority of a thread.
#pragma once

#include <pthread.h>
#include <sched.h>

namespace narpa {

/// Gives the calling thread, and those that it starts, SCHED_FIFO at this priority (1..99). False: not permitted
/// (RLIMIT_RTPRIO, CAP_SYS_NICE).
inline bool take_fifo_priority(int priority) noexcept {
    sched_param parameters{};
    parameters.sched_priority = priority;
    return ::pthread_setschedparam(::pthread_self(), SCHED_FIFO, &parameters) == 0;
}

}  // namespace narpa
