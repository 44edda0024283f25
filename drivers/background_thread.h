/// drivers/background_thread.h - starts a thread with all signals blocked: the thread that started the program
/// handles them.
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
