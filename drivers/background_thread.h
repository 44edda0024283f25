/// drivers/background_thread.h - a thread that no signal reaches: signals belong to the thread that started the
/// program.
#pragma once

#include <pthread.h>
#include <signal.h>

#include <thread>

namespace narpa {

inline std::thread start_without_signals(auto body) {
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    std::thread thread(body);
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
    return thread;
}

}  // namespace narpa
