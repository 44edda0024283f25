// Programs started, watched and ended; what a rerun compares.
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/rerun.h"
#include "tests/rehearsal/judge_support.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

using namespace test;
using narpa::test::TemporaryFolder;

ChildProcess::Command shell(const TemporaryFolder& folder, const std::string& words) {
    return {"it", {"/bin/sh", "-c", words}, {{"WHERE", "here & there"}}, folder / "out", folder / "err"};
}

int status_of(ChildProcess& child) {
    while (!child.status()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return *child.status();
}

TEST(ChildProcess, TellsHowItEndedAndWhatItSaid) {
    const TemporaryFolder folder;
    auto child = ChildProcess::start(shell(folder, "echo \"$WHERE\"; echo first >&2; echo last >&2; exit 3"));
    ASSERT_TRUE(child);
    EXPECT_EQ(status_of(*child), 3);
    EXPECT_EQ(read_text(folder / "out"), "here & there\n");
    EXPECT_EQ(last_line(folder / "err"), "last");
    EXPECT_EQ(last_line(folder / "none"), "");
}

TEST(ChildProcess, WhatCannotBeStartedIsSaid) {
    const TemporaryFolder folder;
    const auto child = ChildProcess::start({"the dynamics", {folder / "none"}, {}, folder / "out", folder / "out"});
    ASSERT_FALSE(child);
    EXPECT_NE(child.error().what.find("cannot start the dynamics"), std::string::npos);
}

TEST(ChildProcess, EndsWithAllThatItStarted) {
    const TemporaryFolder folder;
    auto child = ChildProcess::start(shell(folder, "trap '' TERM; sleep 100 & echo $!; wait; sleep 100"));
    ASSERT_TRUE(child);
    while (read_text(folder / "out").find('\n') == std::string::npos)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const int grandchild = std::stoi(read_text(folder / "out"));
    child->end(0.05);
    // Gone, or a zombie that nobody has waited for yet.
    for (int i = 0; i < 1000; ++i) {
        const std::string stat = read_text("/proc/" + std::to_string(grandchild) + "/stat");
        if (stat.empty() || stat.find(") Z") != std::string::npos) return;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    FAIL() << "process " << grandchild << " is still there";
}

TEST(ChildProcess, ItsLineReadsAsAShellTakesIt) {
    ChildProcess::Command c;
    c.line = {"/bin/echo", "a b", "it's", "plain"};
    EXPECT_EQ(ChildProcess::shell_line(c), "/bin/echo 'a b' 'it'\\''s' plain");
}

TEST(Rerun, TheFirstDifferenceIsFoundByLine) {
    const TemporaryFolder folder;
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

TEST(Rerun, OfWhatIsNoRehearsalIsRefused) {
    const TemporaryFolder folder;
    EXPECT_FALSE(read_record(folder / ""));
    std::ofstream(folder / "rehearsal.json") << R"({"format": 1, "seed": "x"})";
    EXPECT_FALSE(read_record(folder / ""));
}

TEST(Folder, OfOthersIsNotTaken) {
    const TemporaryFolder folder;
    EXPECT_TRUE(claim_folder(folder / "new", "rehearsal.json"));
    EXPECT_TRUE(claim_folder(folder / "new", "rehearsal.json"));
    std::ofstream(folder / "new/letter.txt") << "dear";
    const Status other = claim_folder(folder / "new", "rehearsal.json");
    ASSERT_FALSE(other);
    EXPECT_NE(other.error().what.find("holds other files"), std::string::npos);
    std::ofstream(folder / "new/rehearsal.json") << "{}";
    EXPECT_TRUE(claim_folder(folder / "new", "rehearsal.json"));
}

}  // namespace
}  // namespace narpa::rehearsal
