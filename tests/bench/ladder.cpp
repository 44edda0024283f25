// What `narpa bench render --scenes` concludes from its measurements: speed-ups, gates.
#include <gtest/gtest.h>

#include "bench/gates.h"
#include "bench/statistics.h"

namespace narpa {
namespace {

Rung rung(const char* name, double seconds, double rmse) {
    Rung r;
    r.name = name, r.seconds = {seconds}, r.cpu_seconds = {3 * seconds}, r.rmse = {rmse, 0}, r.predicted = rmse;
    return r;
}
Rung loop_rung(double seconds, double rmse) {
    Rung r = rung("loop 4 spp", seconds, rmse);
    r.loop = true, r.predicted = {};
    return r;
}
Rung adaptive(double seconds, double rmse) {
    Rung r = rung("2 rays/px", seconds, rmse);
    r.adaptive = true;
    return r;
}

/// The loop's error falls with the root of its time, from 1 at 1 s to 0.25 at 16 s.
SceneLadder beside_the_loop(std::vector<Rung> rungs) {
    rungs.push_back(loop_rung(1, 1));
    rungs.push_back(loop_rung(16, 0.25));
    return {"box", 8, 8, 64, 0, 0, {10, 0.01, 1e-3, std::move(rungs)}};
}

std::string only_fault(const SceneLadder& scene) {
    const std::vector<std::string> faults = bench_faults(scene);
    EXPECT_EQ(faults.size(), 1u);
    return faults.empty() ? "" : faults.front();
}

TEST(BenchLadder, SpeedUpIsReadBetweenTheLoopsRungs) {
    const Ladder ladder = beside_the_loop({rung("1 spp", 2, 0.5), rung("4 spp", 1, 0.1)}).ladder;
    ASSERT_TRUE(speed_up(ladder, ladder.rungs[0]));
    EXPECT_NEAR(*speed_up(ladder, ladder.rungs[0]), 2, 1e-12);  // the loop takes 4 s to 0.5
    EXPECT_FALSE(speed_up(ladder, ladder.rungs[1]));            // beyond what the loop reached
    Rung twice = ladder.rungs[0];
    twice.cpu_seconds = {4};  // where the loop's threads have 12 s
    EXPECT_NEAR(*speed_up(ladder, twice, TimeBy::cpu), 3, 1e-12);
    EXPECT_EQ(median({3, 1, 2}), 2);
    EXPECT_EQ(median({4, 1, 2, 3}), 2.5);
}

TEST(BenchLadder, AMechanismEarnsWhatItsAbsenceCostsAtEqualError) {
    // The full renderer's error falls with the root of its CPU time: 1 at 3 s, 0.5 at 12 s, 0.25 at 48 s.
    Rung off = rung("8 spp", 12, 0.5), far_off = rung("8 spp", 4, 0.125);
    off.without = far_off.without = "path reuse";
    const Ladder ladder{
        10,
        0.01,
        1e-3,
        {rung("16 spp", 16, 0.25), rung("4 spp", 1, 1), rung("8 spp", 4, 0.5), off, loop_rung(1, 0.5)}};
    ASSERT_TRUE(cost_at_equal_error(ladder, off));
    EXPECT_NEAR(*cost_at_equal_error(ladder, off), 3, 1e-12);
    EXPECT_NEAR(*cost_at_equal_error(ladder, far_off), 12.0 / 192, 1e-12);  // beyond the line
    EXPECT_FALSE(cost_at_equal_error({10, 0.01, 1e-3, {off}}, off));
}

TEST(BenchLadder, SpeedUpsAreOfOneKindOfBudgets) {
    Rung coarse = adaptive(0.001, 0.9);
    coarse.step = FrameStep::no_indirect;
    const Ladder ladder = beside_the_loop({rung("1 spp", 4, 0.5), coarse, adaptive(2, 0.5), adaptive(1, 0.5),
                                           adaptive(0.5, 0.5), adaptive(1, 0.1)})
                              .ladder;
    const auto rays = speed_ups(ladder, true), spp = speed_ups(ladder, false);
    ASSERT_TRUE(rays && spp);
    EXPECT_NEAR(rays->median, 4, 1e-12);
    EXPECT_NEAR(rays->least, 2, 1e-12);
    EXPECT_NEAR(rays->most, 8, 1e-12);
    EXPECT_EQ(rays->budgets, 3u);  // frames that left something out do not count, and the last has none
    EXPECT_NEAR(spp->median, 1, 1e-12);
    EXPECT_FALSE(speed_ups(Ladder{1, 0, 0, {rung("1 spp", 1, 1)}}, false));  // no loop
}

TEST(BenchLadder, PredictedErrorsLieBetweenTheirBounds) {
    Rung r = rung("16 spp", 1, 0.5);
    for (const double good : {0.86, 1.0, 1.39}) {
        r.predicted = good * r.rmse.value;
        EXPECT_TRUE(bench_faults(beside_the_loop({r})).empty()) << good;
    }
    for (const double bad : {0.0, 0.84, 1.41}) {
        r.predicted = bad * r.rmse.value;
        EXPECT_NE(only_fault(beside_the_loop({r})).find("box, 16 spp: the predicted error is"), std::string::npos)
            << bad;
    }
    r.step = FrameStep::sparse;  // with reconstructed pixels
    for (const double good : {0.71, 1.49}) {
        r.predicted = good * r.rmse.value;
        EXPECT_TRUE(bench_faults(beside_the_loop({r})).empty()) << good;
    }
    r.predicted = 1.51 * r.rmse.value;
    EXPECT_EQ(bench_faults(beside_the_loop({r})).size(), 1u);
}

TEST(BenchLadder, AMissingPredictionIsAFaultUnlessTheFrameLeftSomethingOut) {
    Rung r = adaptive(1, 0.5);
    r.predicted = {};
    for (const FrameStep step :
         {FrameStep::refined, FrameStep::one_sample, FrameStep::sparse, FrameStep::coarse_2, FrameStep::coarse_4}) {
        r.step = step;
        EXPECT_NE(only_fault(beside_the_loop({r})).find("have no error estimate"), std::string::npos);
    }
    for (const FrameStep step : {FrameStep::no_indirect, FrameStep::nothing}) {
        r.step = step;
        EXPECT_TRUE(bench_faults(beside_the_loop({r})).empty());
    }
    r.predicted = 0.1;  // a prediction is judged whatever the step
    EXPECT_EQ(bench_faults(beside_the_loop({r})).size(), 1u);
}

TEST(BenchLadder, AnErrorBelowTheReferencesNoiseIsAFault) {
    EXPECT_NE(only_fault(beside_the_loop({rung("64 spp", 1, 0)})).find("better reference"), std::string::npos);
}

TEST(BenchLadder, TheMedianOverBudgetsInRaysMustReachItsSpeedUp) {
    SceneLadder scene = beside_the_loop({rung("1 spp", 4, 0.5), adaptive(2, 0.5)});
    scene.speed_up_min = 1.9;
    EXPECT_TRUE(bench_faults(scene).empty());
    scene.speed_up_min = 2.1;
    EXPECT_NE(only_fault(scene).find("2.00 times as fast as the plain loop"), std::string::npos);
    scene.ladder.rungs[1].rmse.value = 0.1, scene.ladder.rungs[1].predicted = 0.1;
    EXPECT_NE(only_fault(scene).find("no budget's error lies between"), std::string::npos);
}

TEST(BenchLadder, SmallBudgetsCountOnlyWhereTheyAreJudged) {
    SceneLadder scene = beside_the_loop({adaptive(2, 0.5)});
    scene.width = scene.height = 100;
    scene.speed_up_min = 2.1, scene.speed_up_from = 16;
    scene.ladder.rungs[0].rays = 15 * 100 * 100;
    EXPECT_NE(only_fault(scene).find("from 16 rays a pixel on"), std::string::npos);
    scene.ladder.rungs[0].rays = 8 * 100 * 100;
    EXPECT_NE(only_fault(scene).find("no budget's error lies between"), std::string::npos);
}

TEST(BenchLadder, RatiosOfTheCraftMustHold) {
    CraftRatios good{};
    good.near.frame_s = 1.5, good.near.raw.primary_s = 0.6, good.near.raw.shadow_s = 0.4;
    good.far_s = 0.1, good.edge_s = 0.031, good.filled_s = 1;  // from afar it is only reported
    good.still_s = 0.1, good.moved_s = 0.1009;
    good.load_s = 0.29;
    EXPECT_TRUE(bench_faults(good).empty());
    const CraftRatios none{};  // 0 / 0 is no ratio that holds
    EXPECT_EQ(bench_faults(none).size(), 2u);
    CraftRatios bad = good;
    bad.near.frame_s = 1.7, bad.edge_s = 0.05, bad.moved_s = 0.2, bad.load_s = 1;
    EXPECT_EQ(bench_faults(bad).size(), 4u);
}

}  // namespace
}  // namespace narpa
