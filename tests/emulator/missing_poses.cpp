// A body whose poses never come is named: a lockstep run fails for it, a run in real time says so.
#include <nlohmann/json.hpp>

#include "emulator/report.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"

namespace narpa::test {
namespace {

/// The target is commanded too, but all recorded commands are the chaser's.
std::string two_commanded() {
    std::string text = small_scene();
    const std::string name = "name = \"target\"\n";
    return text.insert(text.find(name) + name.size(), "can_id = 0x120\n");
}

/// The chaser has another identifier than the commands.
std::string other_identifier() {
    std::string text = small_scene();
    return text.replace(text.find("0x100"), 5, "0x130");
}

class MissingPoses : public LoopTest {
protected:
    std::unique_ptr<Emulator> run(const std::string& scene_text, bool lockstep, int commands = 5) {
        RunOptions o;
        o.bus = record(commands);
        o.lockstep = lockstep;
        o.video = {{"nav", "none"}};
        return ran(scene(scene_text), o);
    }
};

TEST_F(MissingPoses, FailALockstepRun) {
    const auto emulator = run(two_commanded(), true);
    ASSERT_TRUE(emulator);
    EXPECT_EQ(failures(*emulator),
              std::vector<std::string>{"no pose command was accepted for \"target\" (can_id 0x120); a lockstep run "
                                       "begins when every body with a can_id has a pose"});
    EXPECT_EQ(report(*emulator)["passed"], false);
    EXPECT_NE(to_text(*emulator).find("  failed: no pose command was accepted for \"target\""), std::string::npos);
}

TEST_F(MissingPoses, OfAnotherIdentifierAreCounted) {
    const auto emulator = run(other_identifier(), true);
    ASSERT_TRUE(emulator);
    ASSERT_EQ(failures(*emulator).size(), 1U);
    EXPECT_NE(failures(*emulator)[0].find("\"chaser\" (can_id 0x130); 5 frames had other identifiers"),
              std::string::npos)
        << failures(*emulator)[0];
}

TEST_F(MissingPoses, FailALockstepRunWhoseBusHasNothing) {
    const auto emulator = run(small_scene(), true, 0);
    ASSERT_TRUE(emulator);
    EXPECT_EQ(failures(*emulator).size(), 1U);
}

TEST_F(MissingPoses, AreANoticeInRealTime) {
    const auto emulator = run(two_commanded(), false);
    ASSERT_TRUE(emulator);
    EXPECT_TRUE(failures(*emulator).empty());
    EXPECT_EQ(std::ranges::count(emulator->notices(),
                                 "no pose command was accepted for \"target\" (can_id 0x120); such a body moves as "
                                 "the scene states"),
              1);
}

TEST_F(MissingPoses, NoneIsMissingWhereEveryBodyHasOne) {
    const auto emulator = run(small_scene(), true);
    ASSERT_TRUE(emulator);
    EXPECT_TRUE(failures(*emulator).empty());
    EXPECT_EQ(emulator->bodies_without_a_pose(), "");
    EXPECT_EQ(report(*emulator)["passed"], true);
}

TEST_F(MissingPoses, FailALockstepRunThatIsStoppedAfterCommandsForOtherBodies) {
    const std::string spec = record(1);
    {
        auto bus = open_can_bus(spec, CanRole::client);
        ASSERT_TRUE(bus);
        CanFrame frame;
        PoseCommand late = command(1);
        late.t_valid_ns = 100'000'000'000'000;
        ASSERT_TRUE(encode_fd(command(0), 0x100, frame));
        (*bus)->send(frame);
        ASSERT_TRUE(encode_fd(late, 0x100, frame));
        (*bus)->send(frame);
    }
    StopFlag stop{false};
    RunOptions o;
    o.bus = spec;
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    o.on_refusal = [&](const std::string&) { stop = true; };
    auto emulator = Emulator::create(scene(two_commanded()), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    ASSERT_TRUE((*emulator)->run(stop));
    EXPECT_TRUE((*emulator)->stopped());
    EXPECT_EQ(failures(**emulator).size(), 1U);
}

TEST_F(MissingPoses, FramesThatNobodyGotAreAmongTheFaults) {
    RunOptions o;
    o.bus = "slcan:0";  // without a client
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    auto emulator = Emulator::create(scene(small_scene()), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    StopFlag stop{true};
    ASSERT_TRUE((*emulator)->run(stop));
    EXPECT_TRUE(failures(**emulator).empty()) << "it was stopped while it waited";
    const std::string said = to_text(**emulator);
    const std::string expected = "0 frames received (0 foreign), 0 sent, 2 not (no client, full queue or interface";
    EXPECT_NE(said.find(expected), std::string::npos) << said;
}

TEST_F(MissingPoses, AreTheExitStatus) {
    std::ofstream(folder_ / "scene.toml") << other_identifier();
    const auto [status, said] = run_command(std::string(kTimeLimit) + NARPA_BIN " run " + (folder_ / "scene.toml") +
                                            " --lockstep --video nav=none --can " + record(5) + " 2>&1");
    EXPECT_EQ(status, 1) << said;
    EXPECT_NE(said.find("failed: no pose command was accepted for \"chaser\""), std::string::npos) << said;
}

}  // namespace
}  // namespace narpa::test
