// `narpa bench estimate --only pnp`: trials, tallies and verdict; no test depends on times.
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "bench/estimation/pnp.h"
#include "estimator/pose/pose_estimate.h"
#include "tests/support/command.h"

namespace narpa {
namespace {

TEST(PnpBench, TrialsFollowTheSetting) {
    std::mt19937_64 random(4);
    for (const PnpScene scene : {PnpScene::nominal, PnpScene::half_turn, PnpScene::plane, PnpScene::plane_facing,
                                 PnpScene::line, PnpScene::tiny, PnpScene::camera_plane}) {
        double squares = 0;
        std::size_t inliers = 0;
        for (int k = 0; k < 50; ++k) {
            const auto trial = draw_trial({scene, 20, 0.5, 30, 0.2}, random);
            ASSERT_TRUE(trial) << to_text(scene);
            ASSERT_EQ(trial->body_m.size(), 20u);
            ASSERT_EQ(trial->inliers, 16u);
            EXPECT_GT(trial->bound_rotation_rad, 0);
            EXPECT_NEAR(norm(trial->T_camera_body.t), 30, 0.1);
            for (std::size_t i = 0; i < trial->inliers; ++i, ++inliers) {
                const Vec3 p = trial->T_camera_body * trial->body_m[i];
                ASSERT_GT(p.z, 0);
                squares += std::pow(trial->camera.fx * p.x / p.z + trial->camera.cx - trial->pixels[i].u, 2);
            }
        }
        // The variance of the noise, within four standard deviations.
        const double n = static_cast<double>(inliers);
        EXPECT_NEAR(squares / n, 0.25, 4 * 0.25 * std::sqrt(2 / n)) << to_text(scene);
    }
}

TEST(PnpBench, EveryMethodSolvesTheSameTrials) {
    PnpBenchOptions options;
    options.trials = 60;
    options.points = {12};
    options.noise_px = {0.5};
    options.ranges_m = {20};
    options.hard_cases = false;
    std::size_t reported = 0;
    const StopFlag stop{false};
    const auto cells = run_pnp_bench(
        options, [&](std::size_t, std::size_t of) { reported += of; }, stop);
    ASSERT_EQ(cells.size(), 1u);
    EXPECT_EQ(reported, 1u);
    for (const char* name : {kPnpCold, kPnpWarm, kPnpPeerCold, kPnpPeerWarm, "ITERATIVE", "EPNP", "SQPNP"}) {
        const PnpRow* row = cells[0].row(name);
        ASSERT_NE(row, nullptr) << name;
        EXPECT_EQ(row->trials, 60);
        EXPECT_GT(row->median_us, 0);
    }
    // All refining methods end in the same minimum, at the bound: an RMS over 60 trials is within 0.3 of 1.
    const PnpRow *cold = cells[0].row(kPnpCold), *peer = cells[0].row(kPnpPeerCold);
    EXPECT_EQ(cold->failed, 0);
    EXPECT_NEAR(cold->rotation_rms_bounds, 1, 0.3);
    EXPECT_NEAR(cold->rotation_rms_bounds, peer->rotation_rms_bounds, 0.01);
    EXPECT_NEAR(cells[0].row(kPnpWarm)->rotation_rms_bounds, cold->rotation_rms_bounds, 0.01);
    EXPECT_EQ(judge(cells).cells_with_more_failures, 0);
    const nlohmann::json document = to_json(cells);
    EXPECT_EQ(document[0]["points"], 12);
    EXPECT_EQ(document[0]["rows"].size(), cells[0].rows.size());
    EXPECT_NE(to_text(cells).find("12 points, 0.5 px, 20 m"), std::string::npos);
}

TEST(PnpBench, VerdictComparesErrorsFailuresAndTimes) {
    PnpCell cell{"nominal", 10, 0.5, 30, 0, 1, 0.01, {}};
    cell.rows.push_back({kPnpCold, 1000, 0.9, 1.05, 0.9, 1.2, 0.02, 0, 10});
    cell.rows.push_back({kPnpWarm, 1000, 0.9, 1.05, 0.9, 1.05, 0, 0, 2});
    cell.rows.push_back({kPnpPeerCold, 1000, 0.9, 1.05, 0.9, 1.05, 0.001, 0, 20});
    cell.rows.push_back({kPnpPeerWarm, 1000, 0.9, 1.05, 0.9, 1.05, 0, 0, 8});
    const PnpVerdict verdict = judge({cell});
    EXPECT_EQ(verdict.worst_rms_bounds, 1.2);
    EXPECT_EQ(verdict.cells_with_more_failures, 1);
    EXPECT_EQ(verdict.cold_time_ratio, 0.5);
    EXPECT_EQ(verdict.warm_time_ratio, 0.25);
    cell.rows[0].failed = 0.002;  // within chance of 0.001
    EXPECT_EQ(judge({cell}).cells_with_more_failures, 0);
}

test::Done pnp_bench(const std::string& arguments) {
    return test::run_command(std::string(test::kTimeLimit) +
                             NARPA_BIN " bench estimate --only pnp --nominal-only " + arguments +
                             " --json 2> /dev/null");
}

TEST(PnpBench, RunsFromTheCommandLine) {
    const test::Done done = pnp_bench("--trials 5 --points 6 --noise-px 0.5 --ranges 10,30");
    const auto document = nlohmann::json::parse(done.out, nullptr, false);
    ASSERT_TRUE(document.is_object());
    EXPECT_EQ(document["pnp"]["cells"].size(), 2u);
    EXPECT_EQ(done.status, document["passed"].get<bool>() ? 0 : 1);
}

TEST(PnpBench, RefusesSettingsWithoutTrials) {
    EXPECT_EQ(pnp_bench("--noise-px nan").status, 2);
    EXPECT_EQ(pnp_bench("--ranges inf").status, 2);
    EXPECT_EQ(pnp_bench("--points 3").status, 2);
    // At this range no draw determines the pose: the cell ends without trials.
    PnpBenchOptions far;
    far.trials = 5, far.points = {6}, far.noise_px = {1}, far.ranges_m = {1e12}, far.hard_cases = false;
    const auto cells = run_pnp_bench(
        far, [](std::size_t, std::size_t) {}, StopFlag{false});
    ASSERT_EQ(cells.size(), 1u);
    EXPECT_EQ(cells[0].rows[0].trials, 0);
}

}  // namespace
}  // namespace narpa
