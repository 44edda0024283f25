// The emulator's clock as a client has it: by the fastest of a run's heartbeats, and by those of the run that is
// there.
#include "drivers/can/remote_clock.h"

#include <gtest/gtest.h>

#include "base/time.h"

namespace narpa {
namespace {

constexpr std::int64_t kMs = 1'000'000;

class RemoteClockTest : public testing::Test {
protected:
    /// A heartbeat of this time arrives `delay_ns` late, if time 0 of the run was at `start_ns`.
    void hear(std::int64_t t_ns, std::int64_t delay_ns, std::int64_t start_ns, RunState state = RunState::running) {
        EXPECT_TRUE(clock_.accept({encode(Heartbeat{.t_ns = t_ns, .state = state}), start_ns + t_ns + delay_ns}));
    }
    void expect_start(std::int64_t start_ns) const {
        const std::int64_t before_ns = monotonic_ns(), now_ns = clock_.now_ns(), after_ns = monotonic_ns();
        EXPECT_LE(before_ns - now_ns, start_ns);
        EXPECT_GE(after_ns - now_ns, start_ns);
    }
    RemoteClock clock_;
};

TEST_F(RemoteClockTest, GoesByTheFastestHeartbeat) {
    const std::int64_t start_ns = monotonic_ns() - 100 * kSecond_ns;
    hear(5 * kSecond_ns, 40 * kMs, start_ns);
    expect_start(start_ns + 40 * kMs);
    hear(6 * kSecond_ns, 0, start_ns);
    hear(6 * kSecond_ns, 30 * kMs, start_ns);    // heard again
    hear(7 * kSecond_ns, 3000 * kMs, start_ns);  // this process was stopped for so long
    expect_start(start_ns);
    EXPECT_FALSE(clock_.restarted());
}

TEST_F(RemoteClockTest, FollowsARestartOfTheEmulator) {
    const std::int64_t first_ns = monotonic_ns() - 100 * kSecond_ns, second_ns = first_ns + 90 * kSecond_ns;
    hear(79 * kSecond_ns, 0, first_ns);
    hear(80 * kSecond_ns, 0, first_ns, RunState::stopping);
    EXPECT_FALSE(clock_.restarted());
    hear(0, 2 * kMs, second_ns);
    EXPECT_TRUE(clock_.restarted());
    hear(100 * kMs, 0, second_ns);
    hear(200 * kMs, 5 * kMs, second_ns);
    expect_start(second_ns);
    EXPECT_TRUE(clock_.restarted());
}

}  // namespace
}  // namespace narpa
