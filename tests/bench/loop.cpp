// `narpa bench loop` as it is run, and its parts: counts and the shape of its output; never times.
#include <gtest/gtest.h>
#include <sched.h>

#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "bench/flight.h"
#include "bench/loop.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Done;

Done bench(const std::string& arguments, const std::string& streams) {
    return test::run_command(std::string(test::kTimeLimit) + NARPA_BIN + " bench loop " + arguments + streams);
}

/// The first that this process may use, from the beginning again where there are fewer.
std::vector<int> processors(std::size_t wanted) {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    ::sched_getaffinity(0, sizeof allowed, &allowed);
    std::vector<int> usable, out;
    for (std::size_t cpu = 0; cpu < CPU_SETSIZE; ++cpu)
        if (CPU_ISSET(cpu, &allowed)) usable.push_back(static_cast<int>(cpu));
    for (std::size_t i = 0; i < wanted; ++i) out.push_back(usable[i % usable.size()]);
    return out;
}

void expect_in_order(const nlohmann::json& percentiles) {
    double before = -1e300;
    for (const char* p : {"p50", "p90", "p99", "p99.9", "max"}) {
        EXPECT_GE(percentiles[p].get<double>(), before) << percentiles;
        before = percentiles[p];
    }
}

TEST(BenchLoop, TheDockingSceneRunsAloneAndBesideLoad) {
    const test::TemporaryFolder folder;
    const Done done = bench("--seconds 0.5 --busy 2 --json -o " + (folder / "plot.png"), " 2>/dev/null");
    const auto document = nlohmann::json::parse(done.out);
    SCOPED_TRACE(document.dump(2));
    EXPECT_EQ(done.status, document["passed"] ? 0 : 1);
    EXPECT_EQ(document["faults"].empty(), document["passed"].get<bool>());
    EXPECT_GT(std::filesystem::file_size(folder / "plot.png"), 5000u);

    ASSERT_EQ(document["runs"].size(), 2u);
    EXPECT_EQ(document["runs"][0]["name"], "idle");
    EXPECT_TRUE(document["runs"][0]["load"].empty());
    EXPECT_EQ(document["runs"][1]["name"], "loaded");
    EXPECT_EQ(document["runs"][1]["load"], processors(2));
    for (const auto& run : document["runs"]) {
        ASSERT_EQ(run["cameras"].size(), 1u);
        const auto& camera = run["cameras"][0];
        EXPECT_EQ(camera["name"], "nav");
        EXPECT_EQ(camera["period_ms"], 100);
        EXPECT_DOUBLE_EQ(camera["allowance_ms"], 100 - 0.19 / 2);  // to the middle of the next exposure
        EXPECT_EQ(camera["frames"].get<int>() + camera["skipped"].get<int>(), 5);
        EXPECT_EQ(camera["incomplete"], 0);
        int frames = 0;
        for (const auto& count : camera["steps"]) frames += count.get<int>();
        EXPECT_EQ(camera["frames"], frames);
        EXPECT_GT(camera["render_ms"]["p50"], 0);
        EXPECT_GE(camera["render_ms"]["max"], camera["radiance_ms"]["max"]);  // of which it is a part
        EXPECT_GT(camera["sensor_ms"]["p50"], 0);
        EXPECT_GT(camera["send_ms"]["p50"], 0);
        EXPECT_GT(camera["samples_per_pixel"]["p50"], 0);
        for (const char* times : {"wake_late_ms", "render_ms", "radiance_ms", "sensor_ms", "send_ms",
                                  "mid_exposure_to_hand_over_ms", "hand_over_after_deadline_ms", "allowance_used"})
            expect_in_order(camera[times]);
        ASSERT_EQ(run["lidars"].size(), 1u);
        EXPECT_EQ(run["lidars"][0]["name"], "top");
        EXPECT_GT(run["lidars"][0]["packets"], 0);
        EXPECT_GE(run["page_faults"]["minor"], 0);
        EXPECT_GE(run["page_faults"]["major"], 0);
    }
}

TEST(BenchLoop, ATimeBudgetIsTheAllowance) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "small.toml")
        << "[sun]\ndirection = [-1.0, 0.5, 0.7]\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1.0}\n"
           "[[camera]]\nname = \"c\"\nposition_m = [-5.0, 0.0, 0.0]\nlook_at = [0.0, 0.0, 0.0]\n"
           "resolution = [32, 32]\nfov_horizontal_deg = 30.0\nrate_hz = 20.0\n";
    const Done done =
        bench((folder / "small.toml") + " --idle-only --duration 0.5 --budget-ms 30 --late-max 100 --json",
              " 2>/dev/null");
    EXPECT_EQ(done.status, 0);
    const auto document = nlohmann::json::parse(done.out);
    ASSERT_EQ(document["runs"].size(), 1u);
    const auto& camera = document["runs"][0]["cameras"][0];
    EXPECT_EQ(camera["allowance_ms"], 30);
    EXPECT_EQ(camera["frames"].get<int>() + camera["skipped"].get<int>(), 10);
    EXPECT_TRUE(document["runs"][0]["lidars"].empty());
}

TEST(BenchLoop, FailsWhereItWasInterrupted) {
    // Interrupted as soon as it catches signals, if that is within a minute. (A shell that ignores them has
    // children that do not catch them before they are the program.)
    const char* const until_it_hears =
        "& bench=$!; for try in $(seq 600); do grep -q 'SigCgt:.*[2367abef]$' /proc/$bench/status && break; "
        "sleep 0.1; done; kill -INT $bench; wait $bench";
    const Done done = test::run_command("trap '' INT; " NARPA_BIN
                                        " bench loop --idle-only --duration 60 --late-max 100 --json 2>/dev/null " +
                                        std::string(until_it_hears));
    EXPECT_EQ(done.status, 1);
    EXPECT_EQ(nlohmann::json::parse(done.out)["faults"].back(), "interrupted before the end");
}

TEST(BenchLoop, BadInputIsReported) {
    const Done load = bench("--load 1023", " 2>&1 >/dev/null");
    EXPECT_EQ(load.status, 2);
    EXPECT_NE(load.out.find("--load 1023: this processor is not there"), std::string::npos) << load.out;
    const Done scene = bench("no_such_scene.toml --duration 1", " 2>&1 >/dev/null");
    EXPECT_EQ(scene.status, 2);
    EXPECT_NE(scene.out.find("no_such_scene.toml"), std::string::npos) << scene.out;
}

TEST(CompetingLoad, KeepsProcessesOnTheirProcessorsAndEndsThem) {
    const int cpu = processors(1).front();
    std::vector<int> processes;
    {
        auto load = CompetingLoad::start({cpu, cpu});
        ASSERT_TRUE(load);
        processes = load->processes();
        ASSERT_EQ(processes.size(), 2u);
        for (const int process : processes) {
            EXPECT_EQ(::kill(process, 0), 0);
            cpu_set_t bound;
            CPU_ZERO(&bound);
            do {  // until it has got so far
                ASSERT_EQ(::sched_getaffinity(process, sizeof bound, &bound), 0);
                ::sched_yield();
            } while (CPU_COUNT(&bound) != 1);
            EXPECT_TRUE(CPU_ISSET(static_cast<std::size_t>(cpu), &bound));
        }
    }
    for (const int process : processes) EXPECT_EQ(::kill(process, 0), -1);
}

/// Ten frames fell due: one was never made, two were late, one of these is not whole.
LoopRun bad_run() {
    LoopRun run;
    run.name = "idle";
    CameraRun& camera = run.cameras.emplace_back();
    camera.name = "nav";
    camera.allowance_ns = 50'000'000;
    camera.stats.frames = 9;
    camera.stats.skipped = 1;
    camera.stats.deadline_missed = 2;
    camera.stats.steps.front() = 8;
    camera.stats.steps[static_cast<std::size_t>(FrameStep::nothing)] = 1;
    for (int i = 0; i < 7; ++i) camera.stats.late.add(-25'000'000);
    for (int i = 0; i < 2; ++i) camera.stats.late.add(5'000'000);
    return run;
}

TEST(LoopRun, CountsWhatIsLateAndWhatIsNotWhole) {
    const CameraRun camera = bad_run().cameras[0];
    EXPECT_DOUBLE_EQ(camera.late_fraction(), 0.3);
    EXPECT_EQ(camera.incomplete(), 1u);
    EXPECT_NEAR(camera.allowance_used(0.5), 0.5, 0.02);  // buckets of 3 %
    EXPECT_NEAR(camera.allowance_used(1), 1.1, 0.005);
    EXPECT_EQ(CameraRun{}.late_fraction(), 0);
}

TEST(LoopRun, FaultsAreSentences) {
    const std::vector<LoopRun> runs{bad_run()};
    const std::vector<std::string> faults = loop_faults(runs, 0.1);
    ASSERT_EQ(faults.size(), 2u);
    EXPECT_EQ(faults[0], "idle, camera nav: 1 frames without a whole image, expected none");
    EXPECT_EQ(faults[1], "idle, camera nav: 30 % of the frames late, expected at most 10 %");
    EXPECT_EQ(loop_faults(runs, 0.3).size(), 1u);
    LoopRun none{"idle", {}, {}, {}, {}, {}};
    none.cameras.emplace_back().name = "nav";
    EXPECT_EQ(loop_faults({none}, 1),
              std::vector<std::string>{"idle, camera nav: no frame fell due, expected one at least"});
}

TrajectoryRow row(std::int64_t t_ns, double x_m, double speed_m_s) {
    TrajectoryRow r{t_ns, "chaser", {}, 1};
    r.motion.T_world_body.t = {x_m, 0, 0};
    r.motion.velocity_m_s = {speed_m_s, 0, 0};
    r.motion.rate_rad_s = {0, 0, 0.1};
    return r;
}

TEST(Flight, ReturnsTheWayItCame) {
    const auto rows =
        there_and_back({row(7'000'000'000, 10, 0), row(5'000'000'000, 60, -2), row(6'000'000'000, 30, -1)});
    const std::vector<std::pair<double, double>> expected{{60, -2}, {30, -1}, {10, 0}, {30, 1}, {60, 2}};
    ASSERT_EQ(rows.size(), expected.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
        EXPECT_EQ(rows[i].t_ns, static_cast<std::int64_t>(i) * 1'000'000'000);
        EXPECT_EQ(rows[i].motion.T_world_body.t.x, expected[i].first);
        EXPECT_EQ(rows[i].motion.velocity_m_s.x, expected[i].second);
        EXPECT_EQ(rows[i].motion.rate_rad_s.z, i < 3 ? 0.1 : -0.1);
    }
    EXPECT_TRUE(there_and_back({}).empty());
}

TEST(Flight, IsFlownAgainUntilTheEnd) {
    const std::vector<TrajectoryRow> once = there_and_back({row(0, 60, -2), row(1'000'000'000, 30, -1)});
    ASSERT_EQ(once.size(), 3u);
    const std::vector<TrajectoryRow> flown = repeated(once, 5'000'000'000);
    ASSERT_EQ(flown.size(), 7u) << "three times, in six seconds";
    for (std::size_t i = 0; i < flown.size(); ++i) {
        EXPECT_EQ(flown[i].t_ns, static_cast<std::int64_t>(i) * 1'000'000'000);
        EXPECT_EQ(flown[i].motion.T_world_body.t.x, i % 2 == 0 ? 60 : 30);
    }
    EXPECT_EQ(repeated(once, 1'000'000'000).size(), once.size());
    EXPECT_TRUE(repeated({}, 5'000'000'000).empty());
}

TEST(Flight, ListsFramesByRange) {
    const Flown frames{{9, false, 0, 20, 1, 0.01}, {15.9, true, 3, 30, 0.5, 0.03}, {16, false, 4, 40, 0.1, -1}};
    const nlohmann::json ranges = by_range(frames);
    ASSERT_EQ(ranges.size(), 2u);
    EXPECT_EQ(ranges[0]["from_m"], 16);
    EXPECT_TRUE(ranges[0]["expected_error"].is_null());
    EXPECT_EQ(ranges[1]["to_m"], 16);
    EXPECT_EQ(ranges[1]["frames"], 2);
    EXPECT_EQ(ranges[1]["late"], 1);
    EXPECT_EQ(ranges[1]["steps"], nlohmann::json::parse(R"({"refined": 1, "coarse_2": 1})"));
    EXPECT_EQ(ranges[1]["mid_exposure_to_hand_over_ms"]["max"], 30);
    EXPECT_EQ(ranges[1]["expected_error"]["max"], 0.03);
}

TEST(BenchLoop, FliesATrajectoryAndRefusesOneOfAnotherScene) {
    const test::TemporaryFolder folder;
    const std::string header(kTrajectoryHeader);
    const auto write = [&](const char* name, const std::string& body) {
        std::ofstream(folder / name) << header << "\n0," << body << ",60,3.2,-2.1,0,0,0,1,-2,0,0,0,0,0\n0.5,"
                                     << body << ",59,3.2,-2.1,0,0,0,1,-2,0,0,0,0,0\n";
        return " --trajectory " + (folder / name);
    };
    const Done done = bench("--idle-only --json" + write("flight.csv", "chaser"), " 2>/dev/null");
    const auto document = nlohmann::json::parse(done.out);
    SCOPED_TRACE(document.dump(2));
    EXPECT_EQ(document["duration_s"], 1);  // there and back
    const auto& ranges = document["runs"][0]["cameras"][0]["by_range"];
    ASSERT_EQ(ranges.size(), 1u);
    EXPECT_EQ(ranges[0]["from_m"], 32);
    EXPECT_GE(ranges[0]["frames"], 1);

    const Done refused = bench("--idle-only" + write("other.csv", "probe"), " 2>&1");
    EXPECT_EQ(refused.status, 2);
    EXPECT_NE(refused.out.find("other.csv:2"), std::string::npos) << refused.out;
    EXPECT_NE(refused.out.find("\"probe\""), std::string::npos) << refused.out;
}

}  // namespace
}  // namespace narpa
