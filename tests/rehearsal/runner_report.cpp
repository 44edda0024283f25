// The page and the test reports: well-formed, whole, and telling what there was.
#include <gtest/gtest.h>

#include <fstream>

#include "rehearsal/report/run_report.h"
#include "rehearsal/runner/campaign.h"
#include "tests/rehearsal/judge_support.h"
#include "tests/rehearsal/markup.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

Scenario full_scenario() {
    Scenario s = small_scenario();
    s.title = "Docking <\"small\"> & simple";
    s.gates.corridor = Gates::Corridor{};
    s.gates.keep_out_m = 5;
    s.gates.navigation = Gates::NavigationError{};
    s.gates.contact = CaptureEnvelope{};
    s.faults.push_back({fault_kind("thruster_off"), 3, 5, "+fx", {}});
    return s;
}

std::string page_of(const Scenario& s, const Messages& m, const std::string& folder) {
    Judge judge(s);
    for (const CanFrame& f : m.frames) judge.accept(f, m.ns(0));
    const nlohmann::json record{{"mode", "lockstep"}, {"seed", 3}, {"command_lines", {{"dynamics", "a < b"}}}};
    return rehearsal_page(s, judge.bus(), judge.finish(), record, folder);
}

TEST(Page, IsWellFormedAndNeedsNoNetwork) {
    Scenario s = full_scenario();
    s.navigation.cameras = {"nav"};
    const test::TemporaryFolder folder;
    std::filesystem::create_directory(folder / "navigation");
    std::ofstream(folder / "navigation/hold_far_nav.png") << "not looked at";
    std::filesystem::create_directory(folder / "charts");
    std::ofstream(folder / "charts/side.svg") << "<svg/>";
    const std::string page =
        page_of(s, docking(s, chaser_at(s, {}, {-0.2, 0, 0}), DynamicsPhase::captured, 4), folder / "");
    EXPECT_EQ(markup_error(page), "");
    for (const char* outside : {"http://", "https://", "<script", "<link", "url(//"})
        EXPECT_EQ(page.find(outside), std::string::npos) << outside;
    for (const char* there :
         {"Docking &lt;&quot;small&quot;&gt; &amp; simple", "closing rate", "Holding: far (camera nav)",
          "data:image/png;base64,bm90IGxvb2tlZCBhdA==", "fault: thruster off +fx", "a &lt; b", "From the side",
          "gate failed: corridor", "<td data-of=\"gate\"><b>corridor</b>", "href=\"result.json\"", "a delta-v of"})
        EXPECT_NE(page.find(there), std::string::npos) << there;
}

TEST(Page, ShowsTheEmulatorsFramesWhateverNavigationFlew) {
    Scenario s = full_scenario();
    s.navigation.cameras = {"nav", "far"};
    const test::TemporaryFolder folder;
    std::filesystem::create_directory(folder / "emulator");
    std::ofstream(folder / "emulator/nav.png") << "not looked at";
    std::ofstream(folder / "emulator/nav.ledger.csv") << "frame";
    const std::string page = page_of(s, Messages(s), folder / "");
    EXPECT_EQ(markup_error(page), "");
    for (const char* there : {"data:image/png;base64,bm90IGxvb2tlZCBhdA==", "Camera nav: frames over the whole run",
                              "href=\"emulator/nav.ledger.csv\""})
        EXPECT_NE(page.find(there), std::string::npos) << there;
    EXPECT_EQ(page.find("Camera far"), std::string::npos);
}

TEST(Page, OfARunThatNeverStartedIsWellFormed) {
    const Scenario s = full_scenario();
    const std::string page = page_of(s, Messages(s), "/nowhere");
    EXPECT_EQ(markup_error(page), "");
    EXPECT_NE(page.find("the emulator sent nothing"), std::string::npos);
}

TEST(Page, WithoutMatplotlibIsWholeAndNamesWhatIsMissing) {
    const Scenario s = full_scenario();
    const std::string page = page_of(s, docking(s, chaser_at(s, {0, 0.02, 0}, {-0.07, 0, 0})), "/nowhere");
    EXPECT_EQ(markup_error(page), "");
    for (const char* there : {"needs python3-matplotlib", "<h2>Gates</h2>", "lateral misalignment"})
        EXPECT_NE(page.find(there), std::string::npos) << there;
}

TEST(Charts, HaveWhatWasOnTheBus) {
    const Scenario s = full_scenario();
    const Messages m = docking(s, chaser_at(s, {0, 0.02, 0}, {-0.07, 0, 0}));
    Judge judge(s);
    for (const CanFrame& f : m.frames) judge.accept(f, m.ns(0));
    const Verdict v = judge.finish();
    const nlohmann::json d = rehearsal_plot(s, judge.bus(), v);
    EXPECT_EQ(d["plot"], "rehearsal");
    const std::size_t poses = judge.bus().truth.size();
    ASSERT_GT(poses, 0u);
    for (const char* key : {"t_s", "position_m", "range_m", "closing_m_s", "lateral_m_s"})
        EXPECT_EQ(d["truth"][key].size(), poses) << key;
    EXPECT_EQ(d["truth"]["range_m"].back(), judge.bus().truth.back().range_m());
    for (const char* key : {"t_s", "port_position_m", "position_error_m", "attitude_sigma_rad"})
        EXPECT_EQ(d["estimates"][key].size(), judge.bus().estimates.size()) << key;
    EXPECT_EQ(d["gates"]["corridor"]["radius_m"], s.gates.corridor->radius_m);
    EXPECT_EQ(d["gates"]["keep_out_m"], 5);
    EXPECT_TRUE(d["contact"]["captured"]);
    EXPECT_EQ(d["thrusters"]["delta_v_m_s"].size(), judge.bus().commands.size());
}

TEST(Charts, BecomePartOfThePage) {
    const Scenario s = full_scenario();
    const test::TemporaryFolder folder;
    EXPECT_NE(page_of(s, Messages(s), folder / "").find("narpa-plot charts.json"), std::string::npos);
    std::filesystem::create_directory(folder / "charts");
    std::ofstream(folder / "charts/range.svg") << "foobar";
    const std::string html = page_of(s, Messages(s), folder / "");
    EXPECT_EQ(markup_error(html), "");
    EXPECT_NE(html.find("alt=\"Range over time\" src=\"data:image/svg+xml;base64,Zm9vYmFy\""), std::string::npos);
    EXPECT_EQ(html.find("alt=\"Rates"), std::string::npos) << "what was not drawn";
}

RunResult run_of(std::size_t k, const Scenario& s, const Messages& m) {
    RunResult r{k, k + 10, "runs/000" + std::to_string(k), to_json(judge(s, m))};
    r.result["seed"] = r.seed;
    r.result["trouble"] = "";
    return r;
}

std::vector<RunResult> four_runs(const Scenario& s) {
    std::vector<RunResult> runs;
    runs.push_back(run_of(1, s, docking(s, chaser_at(s, {0, 0.02, 0}, {-0.07, 0, 0}))));
    runs.push_back(run_of(2, s, docking(s, chaser_at(s, {0, 0.04, 0}, {-0.09, 0, 0}))));
    runs.push_back(run_of(3, s, docking(s, chaser_at(s, {0, 0.15, 0}, {-0.08, 0, 0}))));
    runs.push_back(run_of(4, s, docking(s, chaser_at(s, {}, {-0.07, 0, 0}), DynamicsPhase::captured, 4)));
    return runs;
}

TEST(Campaign, CountsAndExplains) {
    const Scenario s = full_scenario();
    const nlohmann::json summary = summarise(s, four_runs(s));
    EXPECT_EQ(summary["succeeded"], 2);
    EXPECT_EQ(summary["judged"], 4);
    EXPECT_FALSE(summary["passed"]);
    EXPECT_EQ(campaign_headline(summary), "2 of 4 runs succeeded: 50.0 %");
    EXPECT_EQ(summary["failures"]["contact"][0]["run"], 3);
    EXPECT_EQ(summary["failures"]["contact"][0]["folder"], "runs/0003");
    EXPECT_EQ(summary["failures"]["corridor"][0]["run"], 4);
    EXPECT_NEAR(summary["contact"][0]["mean"].get<double>(), (0.07 + 0.09 + 0.08 + 0.07) / 4, 1e-4);
    EXPECT_NEAR(summary["contact"][2]["max"].get<double>(), 0.15, 1e-5);
    EXPECT_NEAR(summary["success_interval_95"][0].get<double>(), 0.0676, 1e-4);  // R: binom.test(2, 4)
}

TEST(Campaign, PageAndTestReportAreWellFormed) {
    const Scenario s = full_scenario();
    std::vector<RunResult> runs = four_runs(s);
    runs.push_back({5, 15, "runs/0005", nullptr});
    runs[0].draws = {{"start_position", {0.5, -1.25, 2.0}}};
    const nlohmann::json summary = summarise(s, runs);
    EXPECT_EQ(summary["judged"], 4);
    EXPECT_EQ(campaign_headline(summary),
              "Incomplete: 4 of 5 runs were flown, 2 of them succeeded. The same command goes on with the rest");
    const std::string page = campaign_page(s, summary, "/nowhere");
    EXPECT_EQ(markup_error(page), "");
    EXPECT_NE(page.find("<td class=\"n\">0.50, -1.25, 2.00</td>"), std::string::npos) << "the draws of run 1";
    EXPECT_NE(page.find(">incomplete<"), std::string::npos);
    EXPECT_EQ(campaign_plot(s, contacts_of(runs))["runs"].size(), 4u) << "the run without a result has no contact";
    const std::string xml = campaign_junit("a&b", runs);
    EXPECT_EQ(markup_error(xml), "");
    EXPECT_NE(xml.find("tests=\"5\" failures=\"2\" errors=\"0\" skipped=\"1\""), std::string::npos) << xml;
    EXPECT_EQ(markup_error(campaign_page(s, summarise(s, {}), "/nowhere")), "");
}

TEST(Campaign, ARunWithItsResultIsNotRepeated) {
    const test::TemporaryFolder folder;
    const auto leave = [&](const char* result) { std::ofstream(folder / "result.json") << result; };
    EXPECT_FALSE(is_done(folder / "", "abc", 4));
    leave(R"({"scenario_hash": "abc", "seed": 4, "trouble": ""})");
    EXPECT_TRUE(is_done(folder / "", "abc", 4));
    EXPECT_FALSE(is_done(folder / "", "abd", 4));
    EXPECT_FALSE(is_done(folder / "", "abc", 5));
    leave(R"({"scenario_hash": "abc", "seed": 4, "trouble": "interrupted"})");
    EXPECT_FALSE(is_done(folder / "", "abc", 4));
    leave(R"({"scenario_hash": "ab)");
    EXPECT_FALSE(is_done(folder / "", "abc", 4));
}

TEST(Junit, IsWellFormed) {
    Scenario s = full_scenario();
    s.legs[0].name = "<&>";
    EXPECT_EQ(markup_error(junit(judge(s, docking(s, chaser_at(s, {}, {-0.2, 0, 0}), DynamicsPhase::bounced, 4)),
                                 "s'\"", 1)),
              "");
}

}  // namespace
}  // namespace narpa::rehearsal
