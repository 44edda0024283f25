// `narpa bench render` as it is run: the real path tracer on the Cornell box that ships, and what a user can get
// wrong.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

using test::Done;

Done bench(const std::string& arguments, const char* streams) {
    return test::run_command(std::string(test::kTimeLimit) + NARPA_BIN + " bench render " + arguments + streams);
}

TEST(BenchRender, TheCornellBoxConvergesToItsReferenceWithoutBias) {
    const test::TemporaryFolder folder;
    const Done done =
        bench("--size 20x20 --seeds 16 --reference-spp 1024 --json -o " + (folder / "plot.png"), " 2>/dev/null");
    const auto document = nlohmann::json::parse(done.out);
    SCOPED_TRACE(document.dump(2));
    EXPECT_EQ(done.status, 0);
    EXPECT_TRUE(document["passed"]);
    EXPECT_GT(std::filesystem::file_size(folder / "plot.png"), 5000u);

    const double slope = document["slope"]["value"], slope_error = document["slope"]["standard_error"];
    EXPECT_LT(slope, -0.47);
    EXPECT_GT(slope, -1.5);  // what the best low-discrepancy points reach on smooth integrands
    EXPECT_LT(slope_error, 0.2);
    const double relative = document["relative_slope"]["value"];
    EXPECT_LT(relative, -0.47);
    EXPECT_GT(relative, -1.0);
    ASSERT_EQ(document["rows"].size(), 4u);
    double before = INFINITY;
    for (const auto& row : document["rows"]) {
        // 16 seeds on either side: Student's t of about 30 degrees is beyond 3.5 in 0.15 % of all cases.
        EXPECT_LT(std::abs(row["bias"]["value"].get<double>()), 3.5 * row["bias"]["standard_error"].get<double>());
        const double rmse = row["rmse"]["value"];
        EXPECT_GT(rmse, 0);
        EXPECT_LT(rmse, before);
        EXPECT_GT(row["samples_per_s"], 0);
        before = rmse;
    }
    EXPECT_LT(document["reference"]["noise_rms"], before / 2);
    EXPECT_GT(document["reference"]["mean"], 0.05);  // the lamp of 10 W m^-2 sr^-1 lights the walls
    EXPECT_LT(document["reference"]["mean"], 1.0);
}

TEST(BenchProgram, WhereItIsNotBuiltSaysHowToBuildIt) {
    const test::TemporaryFolder folder;
    std::filesystem::copy_file(NARPA_BIN, folder / "narpa");
    const Done done = test::run_command("PATH= " + (folder / "narpa") + " bench render 2>&1 >/dev/null");
    EXPECT_EQ(done.status, 3);
    EXPECT_NE(done.out.find("--target narpa-bench"), std::string::npos) << done.out;
}

TEST(BenchRender, AFailedComparisonEndsWithStatusOne) {
    // The even light of [ambient] on a surface that fills the view: no sample differs from another.
    const test::TemporaryFolder folder;
    std::ofstream(folder / "flat.toml")
        << "[ambient]\nradiance = 1.0\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1.0}\n"
           "[[camera]]\nname = \"c\"\nposition_m = [0.0, -2.0, 0.0]\nlook_at = [0.0, 0.0, 0.0]\n"
           "resolution = [8, 8]\nfov_horizontal_deg = 20.0\n";
    const Done done = bench((folder / "flat.toml") + " --reference-spp 64 --json", " 2>/dev/null");
    EXPECT_EQ(done.status, 1);
    const auto document = nlohmann::json::parse(done.out);
    EXPECT_FALSE(document["passed"]);
    EXPECT_NE(document["faults"][0].get<std::string>().find("no slope"), std::string::npos) << document["faults"];
}

TEST(BenchRender, TheAblationSwitchesOffEachMechanism) {
    const Done done = bench("--ablation --scenes craft-and-ball --quick --json", " 2>/dev/null");
    EXPECT_EQ(done.status, 0);
    const auto document = nlohmann::json::parse(done.out);
    SCOPED_TRACE(document.dump(2));
    std::size_t off = 0, full = 0;
    for (const auto& rung : document["scenes"][0]["rungs"]) {
        EXPECT_GT(rung["rmse"]["value"], 0);
        if (!rung.contains("without")) {
            ++full;
            continue;
        }
        EXPECT_GT(rung["cost_at_equal_error"], 0);
        ++off;
    }
    EXPECT_EQ(full, 3U);
    EXPECT_EQ(off, 6U);
}

TEST(BenchRender, TheLadderMeasuresTheCraftBesideEmbreeAndThePlainLoop) {
    const test::TemporaryFolder folder;
    const Done done = bench("--scenes craft --quick --json -o " + (folder / "ladder.png"), " 2>/dev/null");
    EXPECT_EQ(done.status, 0);  // without --gates, whatever the ratios of such small pictures
    const auto document = nlohmann::json::parse(done.out);
    SCOPED_TRACE(document.dump(2));
    const auto& craft = document["craft"];
    EXPECT_NEAR(craft["covered"].get<double>(), 0.27, 0.02);
    for (const char* time : {"frame_s", "radiance_s", "detector_s", "far_s", "far_raw_s", "edge_s", "filled_s",
                             "still_s", "moved_s", "load_s"})
        EXPECT_GT(craft[time].get<double>(), 0) << time;
    ASSERT_EQ(document["scenes"].size(), 1u);
    double before = INFINITY;  // the plain loop's error falls from rung to rung: 1, 4, 16, 64, 256 spp
    int loops = 0;
    for (const auto& rung : document["scenes"][0]["rungs"]) {
        EXPECT_GT(rung["rays"].get<double>(), 0) << rung;
        EXPECT_EQ(rung["seconds"].size(), 2u);
        ASSERT_EQ(rung["cpu_seconds"].size(), 2u);
        for (const auto& frame : rung["cpu_seconds"]) EXPECT_GT(frame.get<double>(), 0) << rung;
        if (!rung["loop"].get<bool>()) {
            EXPECT_GT(rung["predicted"].get<double>(), 0) << rung;  // by direct light each frame has one
            EXPECT_GT(rung["phase_s"]["rays"].get<double>(), 0) << rung;
            continue;
        }
        EXPECT_LT(rung["rmse"]["value"].get<double>(), before);
        before = rung["rmse"]["value"].get<double>();
        ++loops;
    }
    EXPECT_EQ(loops, 5);
    EXPECT_GT(document["scenes"][0]["detector_s"].get<double>(), 0);
    EXPECT_GE(document["scenes"][0]["speed_up"]["rays"]["budgets"].get<int>(), 2);
    EXPECT_GT(std::filesystem::file_size(folder / "ladder.png"), 5000u);
}

struct Mistake {
    const char* arguments;
    const char* words;  ///< must be in the message
};
void PrintTo(const Mistake& m, std::ostream* out) {
    *out << m.arguments;
}
class BenchRenderMistake : public ::testing::TestWithParam<Mistake> {};

TEST_P(BenchRenderMistake, IsAnsweredWithASentence) {
    const Done done = bench(GetParam().arguments, " 2>&1 >/dev/null");
    EXPECT_EQ(done.status, 2) << done.out;
    EXPECT_NE(done.out.find(GetParam().words), std::string::npos) << done.out;
}

INSTANTIATE_TEST_SUITE_P(All, BenchRenderMistake,
                         ::testing::Values(Mistake{"--spp 1,4", "--spp 1, expected 2 to 65535"},
                                           Mistake{"--size 64", "--size 64, expected WIDTHxHEIGHT"},
                                           Mistake{"--size 64x0", "expected WIDTHxHEIGHT"},
                                           Mistake{"--size 64x64x64", "expected WIDTHxHEIGHT"},
                                           Mistake{"--seeds 1", "--seeds"}, Mistake{"--scenes moon", "--scenes"},
                                           Mistake{"--scenes cornell --size 8x8", "excludes"},
                                           Mistake{"--gates", "--gates requires --scenes"},
                                           Mistake{"--reference-spp 100", "multiple of 16"},
                                           Mistake{"--camera nadir", "no camera named \"nadir\""},
                                           Mistake{"nowhere.toml", "nowhere.toml"}));

}  // namespace
}  // namespace narpa
