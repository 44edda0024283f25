// Whole rehearsals, with the real programs on slcan, FIFO and UDP: what is left behind, that it repeats, and what
// is said of programs that end too soon.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <set>

#include "base/write_file.h"
#include "rehearsal/runner/campaign.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/merge.h"
#include "rehearsal/runner/rehearsal.h"
#include "rehearsal/runner/rejudge.h"
#include "rehearsal/runner/rerun.h"
#include "rehearsal/runner/run_folder.h"
#include "tests/rehearsal/judge_support.h"
#include "tests/rehearsal/markup.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;

/// The docking that comes with narpa, for a second.
std::string short_scenario(const test::TemporaryFolder& folder) {
    std::ofstream(folder / "short.toml")
        << "[scenario]\nbased_on = \"" << test::build_path("scenes/rehearsal/docking.toml")
        << "\"\nname = \"short\"\nduration_s = 1.0\n";
    return folder / "short.toml";
}

RehearsalOptions options(const test::TemporaryFolder& folder) {
    RehearsalOptions o;
    o.scenario = short_scenario(folder);
    o.folder = folder / "run";
    o.programs = test::build_path("bin");
    o.threads = 1;
    o.version = "test";
    return o;
}

const Console kSilent{[](std::string_view) {}, [](double, double, std::string_view) {}};

class Whole : public testing::Test {
protected:
    const test::TemporaryFolder folder;
    const StopFlag stop{false};
    RehearsalOptions o = options(folder);
};

TEST_F(Whole, WritesAllFilesAndRepeatsByteForByte) {
    const auto done = run_rehearsal(o, kSilent, stop);
    ASSERT_TRUE(done) << done.error().text();
    const Verdict& v = done->verdict;
    EXPECT_FALSE(v.passed);
    EXPECT_EQ(gate(v, "duration").reason, "the goal was not reached when 1 s were over");
    EXPECT_EQ(gate(v, "navigation").state, GateState::passed) << gate(v, "navigation").reason;
    EXPECT_GT(v.ledger.handed_over, 0u);
    for (const char* file :
         {"scenario.toml", "scene.toml", "rehearsal.json", "result.json", "junit.xml", "index.html",
          "emulator/can.log", "emulator/nav.ledger.csv", "dynamics/truth.csv", "navigation/navigation.csv"})
        EXPECT_TRUE(fs::exists(o.folder + "/" + file)) << file;
    EXPECT_FALSE(fs::exists(o.folder + "/nav.fifo"));
    EXPECT_EQ(markup_error(read_text(o.folder + "/index.html")), "");
    EXPECT_EQ(markup_error(read_text(o.folder + "/junit.xml")), "");

    // The live verdict equals that of the emulator's log; whether the first heartbeat was received is chance.
    const auto scenario = read_scenario(o.scenario);
    Judge judge(*scenario);
    ASSERT_TRUE(accept_log(judge, o.folder + "/emulator/can.log"));
    nlohmann::json live = to_json(v), log = to_json(judge.finish());
    live["bus"].erase("heartbeats"), log["bus"].erase("heartbeats");
    EXPECT_EQ(live, log);

    o.folder = folder / "again";
    o.threads = 2;
    ASSERT_TRUE(run_rehearsal(o, kSilent, stop));
    for (const char* file : {"/emulator/can.log", "/emulator/nav.ledger.csv", "/navigation/navigation.csv"})
        EXPECT_FALSE(first_difference(o.folder + file, (folder / "run") + file)) << file;

    // Another seed, other noise of the sensors: a campaign would else fly all of its runs with the same.
    o.folder = folder / "other";
    o.seed = 9;
    ASSERT_TRUE(run_rehearsal(o, kSilent, stop));
    EXPECT_EQ(nlohmann::json::parse(read_text(o.folder + "/emulator/run.json"))["render"]["seed"], 9);
}

TEST_F(Whole, NamesAProgramThatEndsTooSoon) {
    o.navigation = "echo ready; echo out of fuel >&2; sleep 0.2; exit 7";
    const auto done = run_rehearsal(o, kSilent, stop);
    ASSERT_TRUE(done) << done.error().text();
    EXPECT_FALSE(done->verdict.passed);
    EXPECT_EQ(done->verdict.headline, "Flown for 0.0 s, but the navigation ended with status 7: out of fuel")
        << done->verdict.headline;
    EXPECT_NE(full_reason(gate(done->verdict, "complete")).find("; the run broke off: "), std::string::npos)
        << full_reason(gate(done->verdict, "complete"));
    EXPECT_TRUE(fs::exists(o.folder + "/index.html"));
}

TEST_F(Whole, EndsAfterTooLongWithoutProgress) {
    o.dynamics = "sleep 100";
    o.patience_s = 0.3;
    const auto done = run_rehearsal(o, kSilent, stop);
    ASSERT_TRUE(done) << done.error().text();
    EXPECT_NE(done->verdict.headline.find("but nothing moved for 0.3 s"), std::string::npos)
        << done->verdict.headline;
    EXPECT_NE(full_reason(gate(done->verdict, "complete")).find("the dynamics sent nothing"), std::string::npos);
}

TEST_F(Whole, AStatusOfTheUsersNavigationIsNoneOfOurs) {
    o.navigation = "exit 3";
    const auto done = run_rehearsal(o, kSilent, stop);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().kind, ErrorKind::failed) << done.error().text();
}

TEST_F(Whole, FailsWhereNobodyCanSayThatTheNavigationIsReady) {
    o.navigation = "none";
    Console console = kSilent;
    console.navigation_ready = [] { return Error{"nobody is there"}; };
    const auto done = run_rehearsal(o, console, stop);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().what, "nobody is there");
}

TEST_F(Whole, KeepsTheVerdictWhereThePageCannotBeWritten) {
    o.dynamics = "sleep 100";
    o.patience_s = 0.3;
    Console console = kSilent;
    console.print = [&](std::string_view text) {
        if (text.starts_with("dynamics: "))
            for (const char* file : {"charts.json", "index.html"}) fs::create_directory(o.folder + "/" + file);
    };
    const auto done = run_rehearsal(o, console, stop);
    ASSERT_TRUE(done) << done.error().text();
    EXPECT_FALSE(done->verdict.gates.empty());
    ASSERT_FALSE(done->written);
    EXPECT_NE(done->written.error().what.find("Is a directory"), std::string::npos) << done->written.error().text();
    EXPECT_TRUE(fs::exists(o.folder + "/result.json"));
}

TEST_F(Whole, BadInputOfTheEmulatorIsBadInput) {
    o.bus = "slcan:notaport";
    const auto done = run_rehearsal(o, kSilent, stop);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().kind, ErrorKind::bad_input) << done.error().text();
    o = options(folder);
    o.video["nose"] = "/dev/video10";
    EXPECT_NE(run_rehearsal(o, kSilent, stop).error().what.find("does not navigate by this camera"),
              std::string::npos);
}

TEST_F(Whole, AFailedStartKeepsTheEarlierRun) {
    ASSERT_TRUE(run_rehearsal(o, kSilent, stop));
    const auto kept = [&](const char* file) { return read_text(o.folder + "/" + file); };
    const std::string result = kept("result.json"), record = kept("rehearsal.json"), log = kept("emulator/can.log");
    ASSERT_FALSE(result.empty() || log.empty());
    o.video["nav"] = "/dev/video99";
    const auto failed = run_rehearsal(o, kSilent, stop);
    ASSERT_FALSE(failed);
    EXPECT_EQ(failed.error().kind, ErrorKind::missing);
    EXPECT_EQ(failed.error().file, o.folder + "/failed-start/emulator.log");
    EXPECT_NE(read_text(failed.error().file).find("/dev/video99"), std::string::npos);
    EXPECT_EQ(kept("result.json"), result);
    EXPECT_EQ(kept("rehearsal.json"), record);
    EXPECT_EQ(kept("emulator/can.log"), log);
    EXPECT_FALSE(fs::exists(o.folder + "/earlier"));

    o.video.clear();
    ASSERT_TRUE(run_rehearsal(o, kSilent, stop));
    EXPECT_FALSE(fs::exists(o.folder + "/failed-start"));
    EXPECT_FALSE(fs::exists(o.folder + "/earlier"));
}

/// A navigation that the user starts some time after the request.
TEST_F(Whole, WaitsForANavigationStartedByTheUser) {
    o.navigation = "none";
    std::FILE* own = nullptr;
    int asked = 0;
    std::string printed;
    Console console = kSilent;
    console.print = [&](std::string_view words) {
        if (words.starts_with("start your own navigation now")) printed = words;
    };
    const auto value = [&](const std::string& key) {
        const auto at = printed.find("\n  " + key + "=") + key.size() + 4;
        return printed.substr(at, printed.find('\n', at) - at);
    };
    console.navigation_ready = [&] {
        if (++asked < 20) return false;
        own = ::popen((test::build_path("bin/narpa-navigation ") + value("SCENARIO") + " --can " + value("BUS") +
                       " --video " + value("VIDEO") + " --lidar " + value("LIDAR") + " --lockstep")
                          .c_str(),
                      "r");
        std::array<char, 80> line{};
        return std::fgets(line.data(), line.size(), own) != nullptr && std::string_view(line.data()) == "ready\n";
    };
    const auto done = run_rehearsal(o, console, stop);
    ASSERT_NE(own, nullptr);
    EXPECT_EQ(::pclose(own), 0);
    ASSERT_TRUE(done) << done.error().text();
    EXPECT_EQ(gate(done->verdict, "navigation").state, GateState::passed)
        << gate(done->verdict, "navigation").reason;
    EXPECT_EQ(gate(done->verdict, "duration").reason, "the goal was not reached when 1 s were over");

    const auto again = rerun({o.folder, "", "", 1, "test", ""}, kSilent, stop);
    ASSERT_FALSE(again);
    EXPECT_NE(again.error().what.find("a program was started by hand"), std::string::npos) << again.error().text();
}

/// The log of somebody else, whose record is valid but for the commands in it.
TEST_F(Whole, AReplayNeverRunsACommandOfTheLog) {
    const auto scenario = read_scenario(short_scenario(folder));
    ASSERT_TRUE(scenario);
    const std::string proof = folder / "it-ran";
    const nlohmann::json record{{"format", 1},
                                {"scenario", scenario->file},
                                {"scenario_hash", scenario_texts(*scenario)->hash},
                                {"mode", "lockstep"},
                                {"seed", 1u},
                                {"dynamics", ""},
                                {"navigation", ""}};
    RerunOptions log{folder / "log", "", "", 1, "test", test::build_path("bin")};
    fs::create_directories(log.folder);
    for (const char* program : {"dynamics", "navigation"})
        for (const std::string& command : {"touch " + proof, "\x1b[2Jnone; touch " + proof}) {
            nlohmann::json hostile = record;
            hostile[program] = command;
            hostile["command_lines"] = {{program, "touch " + proof}};
            ASSERT_TRUE(write_file(log.folder + "/rehearsal.json", hostile.dump()));
            const auto done = rerun(log, kSilent, stop);
            ASSERT_FALSE(done) << hostile;
            EXPECT_EQ(done.error().kind, ErrorKind::bad_input);
            EXPECT_NE(done.error().text().find("a command in a log is never run by itself"), std::string::npos)
                << done.error().text();
            EXPECT_EQ(done.error().text().find('\x1b'), std::string::npos) << "it reaches no terminal either";
            EXPECT_FALSE(fs::exists(proof)) << hostile;
        }

    // Named by the caller, it is run, if the log is whole.
    log.navigation = "touch " + proof;
    const auto partial = rerun(log, kSilent, stop);
    ASSERT_FALSE(partial);
    EXPECT_EQ(partial.error().file, log.folder + "/emulator/can.log");
    EXPECT_FALSE(fs::exists(proof));
    for (const char* part : {"emulator", "dynamics"}) fs::create_directory(log.folder + "/" + part);
    for (const char* file : {"can.log", "nav.ledger.csv", "nav.truth.csv", "top.sweeps.csv"})
        std::ofstream(log.folder + "/emulator/" + file) << '\n';
    EXPECT_EQ(rerun(log, kSilent, stop).error().file, log.folder + "/dynamics/truth.csv");
    std::ofstream(log.folder + "/dynamics/truth.csv") << '\n';
    log.navigation = "touch " + proof + "; exit 9";
    EXPECT_FALSE(rerun(log, kSilent, stop));
    EXPECT_TRUE(fs::exists(proof));
}

TEST_F(Whole, ASecondRunIntoTheSameFolderIsRefused) {
    o.dynamics = "sleep 100";
    o.patience_s = 0.3;
    std::optional<Result<RehearsalResult>> second;
    Console first = kSilent;
    first.print = [&](std::string_view text) {  // while the first is under way
        if (text.starts_with("dynamics: ")) second = run_rehearsal(o, kSilent, stop);
    };
    ASSERT_TRUE(run_rehearsal(o, first, stop));
    ASSERT_TRUE(second && !*second);
    EXPECT_EQ(second->error().text(), o.folder +
                                          ": is in use by another run that has not ended, expected a folder "
                                          "of its own for each");
    EXPECT_EQ(exit_status(second->error().kind), 2);
    EXPECT_TRUE(fs::exists(o.folder + "/result.json")) << "the first is left alone";
    EXPECT_TRUE(claim_folder(o.folder, FolderKind::run)) << "and is unlocked at its end";
}

nlohmann::json result_in(const std::string& run) {
    nlohmann::json result = nlohmann::json::parse(read_text(run + "/result.json"));
    result["bus"].erase("heartbeats");  // whether the first one was received is chance
    return result;
}

/// The flown scenario, with other gates.
std::string scenario_with(const test::TemporaryFolder& folder, const std::string& name, const std::string& tables) {
    std::ofstream(folder / name) << "[scenario]\nbased_on = \"short.toml\"\n" << tables;
    return folder / name;
}

TEST_F(Whole, IsJudgedAnewByOtherGates) {
    o.folder = folder / "campaign/runs/0001";
    const auto flown = run_rehearsal(o, kSilent, stop);
    ASSERT_TRUE(flown) << flown.error().text();
    ASSERT_EQ(gate(flown->verdict, "navigation").state, GateState::passed);
    const std::string log = read_text(o.folder + "/emulator/can.log");
    const nlohmann::json result = result_in(o.folder);
    EXPECT_EQ(read_text(o.folder + "/scenario.toml").find("based_on"), std::string::npos) << "it stands alone";

    const std::string strict = scenario_with(folder, "strict.toml", "[gates.navigation]\nposition_m = 1e-6\n");
    const auto judged = judge_run(o.folder, strict);
    ASSERT_TRUE(judged) << judged.error().text();
    EXPECT_TRUE(judged->written);
    EXPECT_EQ(gate(judged->verdict, "navigation").state, GateState::failed);
    EXPECT_EQ(result_in(o.folder)["judged_by"], strict);
    EXPECT_EQ(markup_error(read_text(o.folder + "/index.html")), "");
    ASSERT_TRUE(judge_run(o.folder, ""));
    EXPECT_EQ(result_in(o.folder), result) << "by the gates that were flown with";
    EXPECT_EQ(read_text(o.folder + "/emulator/can.log"), log);

    const std::string other = scenario_with(folder, "other.toml", "[control]\nbandwidth_rad_s = 0.09\n");
    const auto refused = judge_run(o.folder, other);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().what.find("([control] differ)"), std::string::npos) << refused.error().text();

    // A campaign keeps what was flown.
    o.folder = folder / "campaign";
    const auto campaign = [&](const std::string& scenario, std::uint64_t seed) {
        o.scenario = scenario;
        o.seed = seed;
        const auto done = run_campaign({o, 1, 1}, kSilent, stop);
        return done ? std::string() : done.error().what;
    };
    EXPECT_NE(campaign(strict, 1).find("`narpa judge " + o.folder + " --gates " + strict + "`"), std::string::npos);
    EXPECT_NE(campaign(other, 1).find("([control] differ)"), std::string::npos);
    EXPECT_NE(campaign(folder / "short.toml", 7).find("was flown with seed 1, expected 7"), std::string::npos);
    EXPECT_EQ(read_text(o.folder + "/runs/0001/emulator/can.log"), log);
    EXPECT_EQ(campaign(folder / "short.toml", 1), "") << "there is nothing to fly";
    EXPECT_EQ(read_text(o.folder + "/runs/0001/emulator/can.log"), log);

    const auto summary = judge_campaign(o.folder, strict, kSilent);
    ASSERT_TRUE(summary) << summary.error().text();
    EXPECT_EQ((*summary)["failures"]["navigation"].size(), 1u) << summary->dump(1);
    EXPECT_EQ((*summary)["judged_by"], strict);
    for (const char* forged : {"{}", "[]", R"({"runs": "many", "each": [{"seed": 1, "run": 1}]})",
                               R"({"runs": 1, "each": [7]})", R"({"runs": 1, "each": [{"seed": -1, "run": 1}]})"}) {
        ASSERT_TRUE(write_file(o.folder + "/summary.json", forged));
        const auto refused_summary = judge_campaign(o.folder, strict, kSilent);
        ASSERT_FALSE(refused_summary) << forged;
        EXPECT_NE(refused_summary.error().what.find("holds no summary of runs"), std::string::npos);
    }
}

/// Passes after a second: no leg has to be flown to its end.
std::string passing_scenario(const test::TemporaryFolder& folder) {
    std::ofstream(folder / "passing.toml")
        << "[scenario]\nbased_on = \"" << test::build_path("scenes/rehearsal/flyaround.toml")
        << "\"\nname = \"passing\"\nduration_s = 1.0\n[gates]\ncomplete = false\n";
    return folder / "passing.toml";
}

TEST_F(Whole, LeanCampaignsAreMerged) {
    o.scenario = passing_scenario(folder);
    o.lean = o.keep_frames = true;
    const auto flown = [&](const std::string& name, std::uint64_t seed) {
        o.folder = folder / name;
        o.seed = seed;
        const auto summary = run_campaign({o, 1, 1}, kSilent, stop);
        ASSERT_TRUE(summary) << summary.error().text();
        EXPECT_TRUE((*summary)["passed"]) << summary->dump(1);
    };
    flown("a", 5);
    flown("b", 2);
    const std::string run = folder / "a/runs/0001";
    std::set<std::string> kept;
    for (const auto& entry : fs::recursive_directory_iterator(run))
        if (!entry.is_directory()) kept.insert(fs::relative(entry.path(), run));
    std::set<std::string> lean(kLeanFiles.begin(), kLeanFiles.end());
    lean.erase("map.toml");  // the navigation of a landing has one
    EXPECT_EQ(kept, lean);
    const auto judged = judge_run(run, "");
    ASSERT_FALSE(judged);

    const auto merged = merge_campaigns({folder / "a", folder / "b"}, folder / "all");
    ASSERT_TRUE(merged) << merged.error().text();
    EXPECT_EQ((*merged)["runs"], 2);
    EXPECT_EQ((*merged)["each"][0]["seed"], 2) << "in the order of the seeds";
    EXPECT_EQ((*merged)["each"][1]["folder"], "../a/runs/0001");
    EXPECT_EQ((*merged)["each"][1]["draws"]["start_position"].size(), 3u);
    EXPECT_EQ(markup_error(read_text(folder / "all/index.html")), "");
    const auto twice = merge_campaigns({folder / "a", folder / "a"}, folder / "all");
    ASSERT_FALSE(twice);
    EXPECT_NE(twice.error().what.find("was flown with seed 5"), std::string::npos) << twice.error().text();
    EXPECT_FALSE(merge_campaigns({folder / "none"}, folder / "all"));
}

TEST_F(Whole, KeepsTheFramesThatTheNavigationGets) {
    o.keep_frames = true;
    ASSERT_TRUE(run_rehearsal(o, kSilent, stop));
    std::ifstream video(o.folder + "/emulator/nav.y4m", std::ios::binary);
    std::string head;
    ASSERT_TRUE(std::getline(video, head));
    EXPECT_TRUE(head.starts_with("YUV4MPEG2 W")) << head;
}

TEST_F(Whole, ACampaignShowsHowFarARunIs) {
    const std::string log = folder / "0001.log";
    EXPECT_EQ(progress_of(log).text, "");
    ASSERT_TRUE(write_file(log,
                           "rehearsing: starting, 2 s so far\nrehearsing: t = 23.0 s of about 92 s, 7.78 m, leg 1 "
                           "\"hold at 2 m\", moving, gates good, 25 %, about 37 s to go\n"));
    EXPECT_EQ(progress_of(log).text, "t = 23.0 s of about 92 s");
    EXPECT_DOUBLE_EQ(progress_of(log).share, 0.25);
    ASSERT_TRUE(write_file(log, "rehearsing: t = 100.0 s of at most 400 s, 7.78 m, 60 s so far\n"));
    EXPECT_EQ(progress_of(log).text, "t = 100.0 s of at most 400 s");
    EXPECT_DOUBLE_EQ(progress_of(log).share, 0.25);
    ASSERT_TRUE(write_file(log, "rehearsing: t = 99.0 s of about 99 s, drawing charts and page, 20 s so far\n"));
    EXPECT_DOUBLE_EQ(progress_of(log).share, 1);
    ASSERT_TRUE(write_file(log, "narpa: interrupted\n"));
    EXPECT_EQ(progress_of(log).text, "");
}

TEST_F(Whole, RejectsImpossibleCampaigns) {
    const auto refused = [&](const RehearsalOptions& run, int jobs) {
        const auto done = run_campaign({run, 2, jobs}, kSilent, StopFlag{false});
        return done ? std::string() : done.error().what;
    };
    o.bus = "vcan0";
    EXPECT_NE(refused(o, 2).find("cannot share a bus"), std::string::npos);
    o = options(folder);
    o.navigation = "none";
    EXPECT_NE(refused(o, 1).find("expected a command that starts it"), std::string::npos);
}

}  // namespace
}  // namespace narpa::rehearsal
