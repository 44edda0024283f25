// Uniform sample plans: how samples are divided among tiles, and which of them paths follow.
#include "renderer/frame/sample_plan.h"

#include <numeric>

#include "tests/renderer/frame/budget_support.h"

namespace narpa {
namespace {

using namespace test;

TEST(SamplePlan, HalfOfAPowerOfTwoSamplesHavePaths) {
    std::uint32_t paths = 0;
    for (std::uint32_t samples = 0; samples < 5000; ++samples) {
        EXPECT_EQ(paths_of(samples), paths) << samples;
        paths += has_path(samples);
    }
    for (std::uint32_t power = 4; power <= 4096; power *= 2) EXPECT_EQ(paths_of(power), power / 2);
    EXPECT_EQ(paths_of(1), 1U);  // a pixel has a path from its first sample on
}

/// A plan of all tiles of an image that does not end with whole tiles.
struct UniformPlan {
    BudgetView view = craft_over_a_globe(75, 51);
    FrameSettings settings = samples_a_pixel(view, 4, 0, RenderSettings::Method::path);
    Frame frame = make_frame(view.render_scene, view.at, view.camera, view.pose, settings);
    std::vector<std::uint32_t> tiles = std::vector<std::uint32_t>(10 * 7);
    SamplePlan plan{tiles.size()};

    UniformPlan() {
        std::iota(tiles.begin(), tiles.end(), 0U);
        plan.make_uniform(frame, tiles);
    }
};

TEST(SamplePlan, UniformStagesAddAtMostOneSampleToAPixelAtATime) {
    const UniformPlan p;
    SamplePlan::Stage before = SamplePlan::none();
    EXPECT_EQ(p.plan.total(before), 0U);
    for (int level = 0; level <= SamplePlan::samples_each(3).level; ++level) {
        const SamplePlan::Stage stage{level};
        for (const std::uint32_t tile : p.tiles) {
            const std::uint32_t n = p.plan.count(tile, 0, stage);
            EXPECT_LE(n - p.plan.count(tile, 0, before), 1U);
            EXPECT_EQ(n, p.plan.count(tile, kTilePixels - 1, stage));  // whole tiles
        }
        before = stage;
    }
    for (int samples = 1; samples <= 3; ++samples) {
        const SamplePlan::Stage stage = SamplePlan::samples_each(samples);
        EXPECT_TRUE(SamplePlan::reaches(stage, samples));
        EXPECT_FALSE(SamplePlan::reaches({stage.level - 1}, samples));
        EXPECT_EQ(p.plan.total(stage), static_cast<std::uint64_t>(samples) * p.view.pixels());
    }
}

TEST(SamplePlan, UniformPlansReachNoMoreThanTheSamplesAllowed) {
    const UniformPlan p;
    const SamplePlan::Stage one = SamplePlan::samples_each(1);
    for (const std::uint64_t samples : {0ULL, 100ULL, 1000ULL, 5000ULL, 100000ULL}) {
        const SamplePlan::Stage stage = p.plan.reach(one, static_cast<double>(samples));
        EXPECT_LE(p.plan.total(stage), p.plan.total(one) + samples);
        EXPECT_GT(p.plan.total({stage.level + 8}), p.plan.total(one) + samples);
        // What an account holds leads to the same stage: the frame can be made again.
        const std::uint64_t taken = p.plan.total(stage) - p.plan.total(one);
        EXPECT_EQ(p.plan.total(p.plan.reach(one, static_cast<double>(taken))), p.plan.total(stage));
    }
}

}  // namespace
}  // namespace narpa
