// The request to end: what one signal, several at once and one more later do to a program of its own.
#include "base/stop.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace narpa {
namespace {

/// As a process gets them that could not look in between.
void raise_at_once(std::initializer_list<int> signals) {
    sigset_t these;
    ::sigemptyset(&these);
    for (const int signal : signals) ::sigaddset(&these, signal);
    ::sigprocmask(SIG_BLOCK, &these, nullptr);
    for (const int signal : signals) ::raise(signal);
    ::sigprocmask(SIG_UNBLOCK, &these, nullptr);
}

TEST(StopOnSignals, OneIsARequest) {
    EXPECT_EXIT(
        {
            stop_on_signals();
            const bool before = stop_flag();
            ::raise(SIGTERM);
            ::_exit(!before && stop_flag() ? 0 : 1);
        },
        testing::ExitedWithCode(0), "");
}

TEST(StopOnSignals, AHangUpIsARequestUnlessItIsIgnored) {
    for (const bool ignored : {false, true})
        EXPECT_EXIT(
            {
                ::signal(SIGHUP, ignored ? SIG_IGN : SIG_DFL);
                stop_on_signals();
                ::raise(SIGHUP);
                ::_exit(stop_flag() ? 3 : 4);
            },
            testing::ExitedWithCode(ignored ? 4 : 3), "");
}

TEST(StopOnSignals, SeveralAtOnceAreOneRequest) {
    EXPECT_EXIT(
        {
            stop_on_signals();
            raise_at_once({SIGINT, SIGTERM});
            ::_exit(stop_flag() ? 0 : 1);
        },
        testing::ExitedWithCode(0), "");
}

TEST(StopOnSignals, OneMoreLaterEndsTheProgram) {
    EXPECT_EXIT(
        {
            stop_on_signals();
            ::raise(SIGINT);
            std::this_thread::sleep_for(std::chrono::milliseconds(2100));
            ::raise(SIGINT);
            ::_exit(1);
        },
        testing::ExitedWithCode(130), "");
}

TEST(StopOnSignals, AReaderThatLeavesIsNoDeath) {
    EXPECT_EXIT(
        {
            stop_on_signals();
            ::raise(SIGPIPE);
            ::_exit(stop_flag() ? 1 : 0);
        },
        testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace narpa
