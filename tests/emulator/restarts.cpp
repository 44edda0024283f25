// Dynamics that begin again, at time 0 or before: another run in the same process, where the scene says so.
#include <future>

#include "tests/drivers/can_support.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"

namespace narpa::test {
namespace {

const std::string kNewRun = "[time]\non_restart = \"new_run\"\n";

class Restarts : public LoopTest {
protected:
    /// Commands `from` to `to` on a memory bus.
    static void send(CanBus& bus, int from, int to) {
        for (int k = from; k <= to; ++k) {
            CanFrame frame;
            ASSERT_TRUE(encode_fd(command(k), 0x100, frame));
            ASSERT_TRUE(bus.send(frame));
        }
    }
    static RunOptions options(const std::string& bus) {
        RunOptions o;
        o.bus = bus;
        o.lockstep = true;
        o.video = {{"nav", "none"}};
        return o;
    }
};

TEST_F(Restarts, EndTheRunAndBeginTheNextWithTheirFirstCommand) {
    const auto client = open_or_fail("memory:restarts", CanRole::client);
    RunOptions o = options("memory:restarts");
    o.video = {{"nav", folder_ / "nav.y4m"}};
    o.log_folder = folder_ / "first";
    auto first = Emulator::create(scene(small_scene() + kNewRun), o);
    ASSERT_TRUE(first) << first.error().text();
    send(*client, 0, 10);
    send(*client, 0, 0);
    const StopFlag stop{false};
    ASSERT_TRUE((*first)->run(stop));
    EXPECT_TRUE((*first)->restarted());
    EXPECT_EQ(camera_of(**first).made(), 11u);

    o.log_folder = folder_ / "second";
    auto second = Emulator::create_next(*std::move(first), o);
    ASSERT_TRUE(second) << second.error().text();
    send(*client, 1, 4);
    send(*client, -30, -30);  // and again, from an earlier time
    ASSERT_TRUE((*second)->run(stop));
    EXPECT_TRUE((*second)->restarted());
    EXPECT_EQ(camera_of(**second).made(), 5u);
    EXPECT_EQ((*second)->can()->counters().taken, 5u);
    second->reset();

    const auto before = read_rows(folder_ / "first/nav.ledger.csv"),
               after = read_rows(folder_ / "second/nav.ledger.csv");
    ASSERT_EQ(before.size(), 11u);
    ASSERT_EQ(after.size(), 5u);
    for (std::size_t i = 0; i < after.size(); ++i)
        EXPECT_EQ(before[i], after[i]) << "the same run as far as it goes";
    // The video goes on in one file: 16 frames.
    std::string video = read_text(folder_ / "nav.y4m");
    std::size_t frames = 0;
    for (std::size_t at = 0; (at = video.find("FRAME\n", at)) != std::string::npos; ++at) ++frames;
    EXPECT_EQ(frames, 16u);
}

TEST_F(Restarts, AreNeitherLateNorRepeatedCommands) {
    const auto client = open_or_fail("memory:repeats", CanRole::client);
    RunOptions o = options("memory:repeats");
    o.duration_s = 1.5;
    auto emulator = Emulator::create(scene(small_scene() + kNewRun), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    send(*client, 0, 10);
    send(*client, 10, 10);  // repeated
    send(*client, 5, 5);    // out of order
    send(*client, 11, 16);
    const StopFlag stop{false};
    ASSERT_TRUE((*emulator)->run(stop));
    EXPECT_FALSE((*emulator)->restarted());
    EXPECT_EQ((*emulator)->can()->counters().past, 1u)
        << "out of order; the bus knows the repeated one as a duplicate";
}

TEST_F(Restarts, AreRefusedAsPastByDefault) {
    const auto client = open_or_fail("memory:refused", CanRole::client);
    RunOptions o = options("memory:refused");
    o.duration_s = 1;
    auto emulator = Emulator::create(scene(small_scene()), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    send(*client, 0, 5);
    send(*client, 0, 5);
    send(*client, 6, 11);
    const StopFlag stop{false};
    ASSERT_TRUE((*emulator)->run(stop));
    EXPECT_FALSE((*emulator)->restarted());
    EXPECT_EQ((*emulator)->can()->counters().past, 6u);
}

}  // namespace
}  // namespace narpa::test
