// Programs started, watched and ended; what a rerun compares.
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "base/ready.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/free_port.h"
#include "rehearsal/runner/rerun.h"
#include "rehearsal/runner/run_folder.h"
#include "tests/rehearsal/judge_support.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

ChildProcess::Command shell(const test::TemporaryFolder& folder, const std::string& words) {
    return {"it", {"/bin/sh", "-c", words}, {{"WHERE", "here & there"}}, folder / "out", folder / "err"};
}

int status_of(ChildProcess& child) {
    while (!child.status()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return *child.status();
}

TEST(ChildProcess, HasItsExitStatusAndOutput) {
    const test::TemporaryFolder folder;
    auto child = ChildProcess::start(shell(folder, "echo \"$WHERE\"; echo first >&2; echo last >&2; exit 3"));
    ASSERT_TRUE(child);
    EXPECT_EQ(status_of(*child), 3);
    EXPECT_EQ(read_text(folder / "out"), "here & there\n");
    EXPECT_EQ(last_line(folder / "err"), "last");
    EXPECT_EQ(last_line(folder / "none"), "");
}

TEST(ChildProcess, NamesWhatCannotBeStarted) {
    const test::TemporaryFolder folder;
    const auto child = ChildProcess::start({"the dynamics", {folder / "none"}, {}, folder / "out", folder / "out"});
    ASSERT_FALSE(child);
    EXPECT_NE(child.error().what.find("cannot start the dynamics"), std::string::npos);
}

TEST(ChildProcess, StopsWithAllThatItStarted) {
    const test::TemporaryFolder folder;
    auto child = ChildProcess::start(shell(folder, "trap '' TERM; sleep 100 & echo $!; wait; sleep 100"));
    ASSERT_TRUE(child);
    while (read_text(folder / "out").find('\n') == std::string::npos)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const int grandchild = std::stoi(read_text(folder / "out"));
    child->stop(0.05);
    // Gone, or a zombie that init has not reaped yet.
    for (int i = 0; i < 1000; ++i) {
        const std::string stat = read_text("/proc/" + std::to_string(grandchild) + "/stat");
        if (stat.empty() || stat.find(") Z") != std::string::npos) return;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    FAIL() << "process " << grandchild << " is still there";
}

TEST(ChildProcess, ItsLineIsQuotedForAShell) {
    ChildProcess::Command c;
    c.line = {"/bin/echo", "a b", "it's", "plain"};
    EXPECT_EQ(ChildProcess::shell_line(c), "/bin/echo 'a b' 'it'\\''s' plain");
}

std::string wait_for_ready(ChildProcess& child) {
    for (int i = 0; i < 5000; ++i) {
        if (auto lines = child.ready()) return *lines;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return "";
}

TEST(ChildProcess, IsReadyWhenItHasWrittenSoToItsDescriptor) {
    const test::TemporaryFolder folder;
    ChildProcess::Command command = shell(
        folder, "echo READY=1; echo CAN=slcan:29537 >&$READY_FD; read line; echo READY=1 >&$READY_FD; sleep 100");
    command.ready = ChildProcess::Ready::variable;
    auto child = ChildProcess::start(command);
    ASSERT_TRUE(child);
    const std::string lines = wait_for_ready(*child);
    EXPECT_EQ(lines, "CAN=slcan:29537\nREADY=1\n");
    EXPECT_EQ(value_of(lines, "CAN"), "slcan:29537");
    EXPECT_EQ(value_of(lines, "AN"), "");
}

TEST(ChildProcess, IsNotReadyWhenItEndsBefore) {
    const test::TemporaryFolder folder;
    ChildProcess::Command command = shell(folder, "echo CAN=vcan0 >&$READY_FD; exit 2");
    command.ready = ChildProcess::Ready::variable;
    auto child = ChildProcess::start(command);
    ASSERT_TRUE(child);
    EXPECT_EQ(status_of(*child), 2);
    EXPECT_FALSE(child->ready());
    command.ready = ChildProcess::Ready::none;
    auto without = ChildProcess::start(command);
    ASSERT_TRUE(without);
    EXPECT_EQ(status_of(*without), 2);
    EXPECT_FALSE(without->ready());
}

TEST(ChildProcess, GetsTheDescriptorAsAnOption) {
    const test::TemporaryFolder folder;
    ChildProcess::Command command = shell(folder, "echo \"$0 $1\"; echo READY=1 >&3");
    command.ready = ChildProcess::Ready::option;
    auto child = ChildProcess::start(command);
    ASSERT_TRUE(child);
    EXPECT_EQ(wait_for_ready(*child), "READY=1\n");
    EXPECT_EQ(status_of(*child), 0);
    EXPECT_EQ(read_text(folder / "out"), "--ready-fd 3\n");
}

TEST(ErrorIn, IsTheErrorWithItsRemedyAndNoMore) {
    const test::TemporaryFolder folder;
    const auto of = [&](const char* printed) {
        std::ofstream(folder / "log") << printed;
        return error_in(folder / "log");
    };
    EXPECT_EQ(of("reading\nnarpa: can7: no such interface\n  try: slcan:29537\n"),
              "can7: no such interface\n  try: slcan:29537");
    EXPECT_EQ(of("narpa-dynamics: it is lost\n"), "it is lost");
    EXPECT_EQ(of("narpa is here\nTraceback: out of fuel\n"), "Traceback: out of fuel");
    EXPECT_EQ(of(""), "");
}

TEST(ReadyFd, ThatIsNotOpenIsBadInput) {
    EXPECT_TRUE(check_ready_fd(-1));
    const Status closed = check_ready_fd(987);
    ASSERT_FALSE(closed);
    EXPECT_EQ(closed.error().what, "--ready-fd 987: expected an open descriptor");
    EXPECT_EQ(closed.error().kind, ErrorKind::bad_input);
}

TEST(Rerun, TheFirstDifferenceIsFoundByLine) {
    const test::TemporaryFolder folder;
    const auto leave = [&](const char* name, const std::string& text) { std::ofstream(folder / name) << text; };
    leave("a", "1\n2\n3\n");
    leave("b", "1\n2\n3\n");
    leave("c", "1\nx\n3\n");
    leave("d", "1\n2\n");
    EXPECT_FALSE(first_difference(folder / "a", folder / "b"));
    EXPECT_EQ(first_difference(folder / "a", folder / "c")->line, 2u);
    EXPECT_EQ(first_difference(folder / "a", folder / "c")->was, "x");
    EXPECT_EQ(first_difference(folder / "a", folder / "d")->line, 3u);
    EXPECT_EQ(first_difference(folder / "d", folder / "a")->was, "3");
    EXPECT_EQ(first_difference(folder / "a", folder / "none")->line, 1u);
}

TEST(Rerun, MessagesHaveNames) {
    const Scenario s = small_scenario();
    EXPECT_EQ(describe_message(s, "(3.050000) narpa 103#A037A00000000700"),
              "t = 3.050000 s: pose of chaser, part 3 (103#A037A00000000700)");
    EXPECT_EQ(describe_message(s, "(3.050000) narpa 751#A037A00000000700"),
              "t = 3.050000 s: dynamics report, part 1 (751#A037A00000000700)");
    EXPECT_EQ(describe_message(s, "(3.050000) narpa 612#A037A00000000700"),
              "t = 3.050000 s: ledger of camera 1, part 2 (612#A037A00000000700)");
    EXPECT_EQ(describe_message(s, ""), "nothing more");
}

TEST(Rerun, RejectsFoldersWithoutARehearsal) {
    const test::TemporaryFolder folder;
    EXPECT_FALSE(read_record(folder / ""));
    std::ofstream(folder / "rehearsal.json") << R"({"format": 1, "seed": "x"})";
    EXPECT_FALSE(read_record(folder / ""));
}

TEST(LidarPort, LeavesRoomForPositionPackets) {
    for (int k = 0; k < 300; ++k) {  // one in twenty that the kernel offers is too high
        const auto port = free_lidar_port();
        ASSERT_TRUE(port) << port.error().text();
        EXPECT_GT(*port, 1023);
        EXPECT_LE(*port + 5940, 65535);
    }
}

TEST(Folder, WithOtherFilesIsNotClaimed) {
    const test::TemporaryFolder folder;
    EXPECT_TRUE(claim_folder(folder / "new", FolderKind::run));
    EXPECT_TRUE(claim_folder(folder / "new", FolderKind::run));
    std::ofstream(folder / "new/letter.txt") << "dear";
    const auto other = claim_folder(folder / "new", FolderKind::run);
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().what.find("holds other files"), std::string::npos);
    std::ofstream(folder / "new/rehearsal.json") << "{}";
    EXPECT_TRUE(claim_folder(folder / "new", FolderKind::run));
    const auto campaign = claim_folder(folder / "new", FolderKind::campaign);
    ASSERT_FALSE(campaign);
    EXPECT_NE(campaign.error().what.find("holds a single run, expected"), std::string::npos);
}

}  // namespace
}  // namespace narpa::rehearsal
