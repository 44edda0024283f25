// A run ends in order, with its exit status and a sentence, whatever ends it: the program itself is run.
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <future>
#include <utility>

#include "renderer/trajectory/trajectory.h"
#include "tests/drivers/can_support.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"

namespace narpa::test {
namespace {

class Ending : public LoopTest {
protected:
    void SetUp() override {
        std::ofstream(folder_ / "scene.toml") << small_scene();
        run_ = std::string(kTimeLimit) + NARPA_BIN " run " + (folder_ / "scene.toml") + " ";
        lockstep_ = run_ + "--lockstep --can " + record(11) + " ";
    }
    /// A file of this name on a disk that is full.
    std::string full(const char* name) {
        const std::string path = folder_ / name;
        EXPECT_EQ(::symlink("/dev/full", path.c_str()), 0);
        return path;
    }
    static void expect_failure(const std::string& command, const std::string& words) {
        const auto [status, said] = run_command(command + " 2>&1");
        EXPECT_EQ(status, 1) << said;
        EXPECT_NE(said.find(words), std::string::npos) << "expected: " << words << "\nsaid: " << said;
    }
    /// Runs the command until it is ready, interrupts it, and expects that it ends well.
    void expect_good_end(const std::string& arguments) {
        const std::string ready = folder_ / "ready";
        const auto [status, said] = run_command(
            "exec 3>" + ready + "; " NARPA_BIN " run " + (folder_ / "scene.toml") + " " + arguments +
            " --ready-fd 3 2>&1 & run=$!; (sleep 120; kill -9 $run) >/dev/null 2>&1 & watch=$!; until grep -q "
            "READY " +
            ready +
            "; do sleep 0.05; done; sleep 0.3; kill -INT $run; wait $run; status=$?; kill $watch; exit $status");
        EXPECT_EQ(status, 0) << arguments << ": " << said;
        EXPECT_NE(said.find("small: "), std::string::npos) << arguments << ": " << said;
    }
    std::string run_, lockstep_;
};

TEST_F(Ending, AFullDiskFailsTheRunWhoseFramesItDidNotTake) {
    if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
    expect_failure(lockstep_ + "--video nav=" + full("nav.y4m"), "11 frames could not be written: No space left");
}

TEST_F(Ending, AFullDiskFailsTheRunWhosePacketsItDidNotTake) {
    // A limit on the file's size stands for a disk that fills up.
    const std::string limit = "trap '' XFSZ; ulimit -f 100; ";
    expect_failure("( " + limit + lockstep_ + "--lidar top=" + (folder_ / "top.pcap") + " )",
                   "packets could not be written: File too large");
}

TEST_F(Ending, AFullDiskFailsTheRunWhoseLogsItDidNotTake) {
    if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
    for (const std::string file : {"can.log", "nav.truth.csv", "nav.ledger.csv"}) {
        const std::string folder = folder_ / ("log_" + file).c_str();
        ASSERT_EQ(::mkdir(folder.c_str(), 0700), 0);
        ASSERT_EQ(::symlink("/dev/full", (folder + "/" + file).c_str()), 0);
        expect_failure(lockstep_ + "--video nav=none --log " + folder, file + ": cannot be written: No space left");
    }
}

TEST_F(Ending, AFullDiskFailsTheProgramWhoseDocumentItDidNotTake) {
    if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
    const auto [status, said] = run_command(lockstep_ + "--video nav=none --json 2>&1 >/dev/full");
    EXPECT_EQ(status, 1) << said;
    EXPECT_NE(said.find("standard output cannot be written: No space left"), std::string::npos) << said;
}

TEST_F(Ending, ARunWhoseMessagesNobodyTakesKeepsItsFiles) {
    const std::string video = folder_ / "nav.y4m", log = folder_ / "log";
    for (const std::string closed : {"2>/dev/full", "2>&-"}) {
        if (closed == "2>/dev/full" && ::access("/dev/full", W_OK) != 0) continue;
        SCOPED_TRACE(closed);
        EXPECT_EQ(run_command(NARPA_BIN " list " + closed).status, 0);
        // Its progress is due after two seconds.
        const auto [status, said] = run_command(run_ + "--video nav=" + video + " --duration 2.5 " + closed);
        EXPECT_EQ(status, 0) << said;
        EXPECT_EQ(read_text(video).find("small: "), std::string::npos) << "its summary is in the video";
        EXPECT_EQ(run_command(lockstep_ + "--video nav=none --log " + log + " " + closed).status, 0);
        EXPECT_EQ(read_rows(log + "/nav.ledger.csv").size(), 11U);
    }
}

TEST_F(Ending, ATrajectoryEndsWhenTheEmulatorStops) {
    const auto hub = open_or_fail("slcan:0", CanRole::hub);
    ASSERT_TRUE(hub);
    std::ofstream file(folder_ / "long.csv");
    file << kTrajectoryHeader << "\n";
    for (int t = 0; t < 100; ++t) file << t << ",chaser,0,0,0,1,0,0,0,0,0,0,0,0,0\n";
    file.close();
    const std::string command = std::string(kTimeLimit) + NARPA_BIN " fly " + (folder_ / "long.csv") +
                                " --can slcan:" + std::to_string(hub_port(*hub));
    auto flight = std::async(std::launch::async, [&] { return run_command(command + " 2>&1"); });
    const std::int64_t start_ns = monotonic_ns();
    bool commanded = false;
    while (flight.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) {
        for (ReceivedFrame out; hub->receive(out);) commanded = true;
        hub->send(encode(Heartbeat{.t_ns = monotonic_ns() - start_ns,
                                   .state = commanded ? RunState::stopping : RunState::running}));
    }
    const auto [status, said] = flight.get();
    EXPECT_EQ(status, 0) << said;
    EXPECT_NE(said.find("the emulator stopped: 1 of 100 rows were sent"), std::string::npos) << said;
}

TEST_F(Ending, ATrajectoryEndsWithTheRunThatItWasFlownFor) {
    const auto hub = open_or_fail("slcan:0", CanRole::hub);
    ASSERT_TRUE(hub);
    std::ofstream(folder_ / "long.csv") << kTrajectoryHeader << "\n0,chaser,0,0,0,1,0,0,0,0,0,0,0,0,0\n"
                                        << "100,chaser,0,0,0,1,0,0,0,0,0,0,0,0,0\n";
    const std::string command = std::string(kTimeLimit) + NARPA_BIN " fly " + (folder_ / "long.csv") +
                                " --can slcan:" + std::to_string(hub_port(*hub));
    auto flight = std::async(std::launch::async, [&] { return run_command(command + " 2>&1"); });
    // A run that has lasted for a minute, until its first command; then another.
    std::int64_t start_ns = monotonic_ns() - 60 * kSecond_ns;
    bool commanded = false;
    while (flight.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) {
        for (ReceivedFrame out; hub->receive(out);)
            if (!std::exchange(commanded, true)) start_ns = monotonic_ns();
        hub->send(encode(Heartbeat{.t_ns = monotonic_ns() - start_ns, .state = RunState::running}));
    }
    const auto [status, said] = flight.get();
    EXPECT_TRUE(commanded);
    EXPECT_EQ(status, 1) << said;
    EXPECT_NE(said.find("the emulator was started again"), std::string::npos) << said;
}

TEST_F(Ending, ASignalEndsARunInEveryState) {
    const std::string fifo = folder_ / "nav.fifo";
    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    expect_good_end("--video nav=none --lidar top=none");                        // it runs
    expect_good_end("--video nav=" + fifo);                                      // without a reader
    expect_good_end("--lockstep --can slcan:0 --video nav=none");                // it waits for a command
    expect_good_end("--lockstep --can " + record(11) + " --video nav=" + fifo);  // it waits for a reader
}

}  // namespace
}  // namespace narpa::test
