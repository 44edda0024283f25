// Cold starts: each trial is its number's alone, and of a few none is wrong.
#include "bench/estimation/cold.h"

#include <gtest/gtest.h>

#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

Result<std::vector<ColdTrial>> run(const ColdOptions& o, int first) {
    static TracingThreads threads(0);
    static const Scene docking = *read_scene(test::build_path("scenes/docking/docking.toml"));
    const StopFlag stop{};
    return run_cold(
        o, docking, first, threads, [](const ColdTrial&) {}, stop);
}

TEST(Cold, FindsACraftAndIsNeverWrong) {
    ColdOptions o;
    o.targets = {"craft", "cube"};
    o.trials = 6;
    const auto trials = run(o, 0);
    ASSERT_TRUE(trials) << trials.error().text();
    ASSERT_EQ(trials->size(), 6u);
    int acquired = 0;
    for (const ColdTrial& t : *trials) {
        EXPECT_FALSE(t.wrong()) << t.number << ": NEES " << t.nees;
        if (t.target == "cube")
            EXPECT_NE(t.answer, AnswerKind::good) << t.number;
        else
            acquired += t.answer == AnswerKind::good;
    }
    EXPECT_GE(acquired, 2);
}

TEST(Cold, ATrialIsItsNumbersAlone) {
    ColdOptions o;
    o.targets = {"craft"};
    o.trials = 2;
    const auto both = run(o, 4);
    o.trials = 1;
    const auto second = run(o, 5);
    ASSERT_TRUE(both && second);
    EXPECT_EQ(both->back().number, second->front().number);
    EXPECT_EQ(both->back().answer, second->front().answer);
    EXPECT_EQ(both->back().rotation_rad, second->front().rotation_rad);
    EXPECT_EQ(both->back().nees, second->front().nees);
}

TEST(Cold, NamesTheTargetThatItDoesNotKnow) {
    ColdOptions o;
    o.targets = {"teapot"};
    const auto none = run(o, 0);
    ASSERT_FALSE(none);
    EXPECT_NE(none.error().what.find("teapot"), std::string::npos);
}

}  // namespace
}  // namespace narpa
