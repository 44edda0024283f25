// Frames within a budget: the same bytes wherever they are made, never more rays than allowed, whole at every step.
#include <atomic>
#include <thread>

#include "renderer/frame/frame_passes.h"
#include "tests/renderer/frame/budget_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

using namespace test;
using Method = RenderSettings::Method;

/// Threads that keep the cores busy while this lives.
class Load {
public:
    explicit Load(int threads) {
        for (int i = 0; i < threads; ++i)
            threads_.emplace_back([this] {
                while (!stop_.load(std::memory_order_relaxed)) {
                }
            });
    }
    ~Load() {
        stop_ = true;
        for (std::thread& t : threads_) t.join();
    }
    Load(const Load&) = delete;
    Load& operator=(const Load&) = delete;

private:
    std::atomic<bool> stop_{false};
    std::vector<std::thread> threads_;
};

Shown render_on(int threads, const BudgetView& v, const FrameSettings& s) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    std::optional<Shown> shown;
    tbb::task_arena(threads).execute([&] { shown = render(v, s); });
    return *std::move(shown);
}

void expect_the_same(const Shown& a, const Shown& b) {
    EXPECT_TRUE(same_bytes(a.image, b.image));
    EXPECT_EQ(a.account.step, b.account.step);
    EXPECT_EQ(a.account.passes, b.account.passes);
    EXPECT_EQ(a.account.rays, b.account.rays);
    EXPECT_EQ(a.account.samples, b.account.samples);
    EXPECT_EQ(a.account.rays_discarded, b.account.rays_discarded);
    EXPECT_EQ(a.account.standard_error, b.account.standard_error);
}

TEST(BudgetFrame, RaysGiveTheSameBytesTwentyTimesOnAnyThreadsUnderAnyLoad) {
    const BudgetView v = craft_over_a_globe(48, 35);
    for (const auto& [method, rays] : {std::pair{Method::direct, 5}, {Method::path, 12}, {Method::path, 40}}) {
        const FrameSettings s = rays_a_pixel(v, rays, 3, method);
        const Shown first = render_on(1, v, s);
        EXPECT_EQ(first.account.step, FrameStep::refined);
        for (int run = 0; run < 20; ++run) {
            const Load load(run % 4);
            expect_the_same(first, render_on(1 + run % 7, v, s));
        }
    }
}

TEST(BudgetFrame, FramesBeforeItLeaveNoTrace) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer kept(v.render_scene, v.camera);
    std::uint32_t frame = 0;
    for (const double rays : {30.0, 0.03, 4.0, 0.3, 1.2, 60.0, 2.0})
        for (const Method method : {Method::path, Method::direct}) {
            const FrameSettings s = rays_a_pixel(v, rays, frame++, method);
            expect_the_same(render(kept, v, s), render(v, s));
        }
}

TEST(BudgetFrame, NeverMoreRaysThanTheBudget) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    for (const Method method : {Method::direct, Method::path})
        for (double rays = 0.01; rays < 100; rays *= 1.37) {
            const FrameSettings s = rays_a_pixel(v, rays, 1, method);
            const FrameAccount account = render(renderer, v, s).account;
            EXPECT_LE(account.rays + account.rays_discarded, s.budget.rays) << rays;
            // And nearly as many where there is something to spend them on.
            if (rays > 20) {
                EXPECT_GE(account.rays, 0.9 * static_cast<double>(s.budget.rays)) << rays;
            }
        }
}

/// A frame that stops at this step, whatever it costs.
Shown at_step(const BudgetView& v, FrameStep step, Method method, std::uint32_t frame) {
    FrameAccount account;
    account.step = step;
    return render(v, replay_of(rays_a_pixel(v, 0, frame, method), account));
}

/// Budgets, in rays a pixel, that end at all steps one after another.
std::vector<double> ladder_of(const BudgetView& v, Method method, std::uint32_t frame) {
    std::vector<double> rays;
    for (double r = 0.001; r < 60; r *= 1.5) rays.push_back(r);
    // Where one sample a pixel fits and nothing beyond it.
    const double one = static_cast<double>(at_step(v, FrameStep::one_sample, method, frame).account.rays);
    rays.push_back(1.045 * one / static_cast<double>(v.pixels()));
    std::sort(rays.begin(), rays.end());
    return rays;
}

TEST(BudgetFrame, IsMadeAnewFromItsAccount) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    for (const Method method : {Method::direct, Method::path})
        for (const double rays : ladder_of(v, method, 9)) {
            const FrameSettings s = rays_a_pixel(v, rays, 9, method);
            const Shown shown = render(renderer, v, s);
            const Shown again = render(v, replay_of(s, shown.account));
            EXPECT_TRUE(same_bytes(shown.image, again.image)) << rays;
            EXPECT_EQ(shown.account.step, again.account.step) << rays;
            EXPECT_EQ(shown.account.passes, again.account.passes) << rays;
            EXPECT_EQ(shown.account.standard_error, again.account.standard_error) << rays;
        }
}

TEST(BudgetFrame, IsMadeAnewFromItsAccountIfTheClockChose) {
    const BudgetView v = craft_over_a_globe(360, 255);
    CameraRenderer renderer(v.render_scene, v.camera);
    for (const Method method : {Method::direct, Method::path}) {
        render(renderer, v, rays_a_pixel(v, 60, 0, method));  // measures costs
        for (std::uint32_t k = 1; k <= 60; ++k) {
            FrameSettings s = rays_a_pixel(v, 0, k, method);
            s.budget.kind = BudgetKind::time;
            s.budget.deadline_ns = now_ns() + std::int64_t{300'000} * k;
            const Shown shown = render(renderer, v, s);
            const Shown again = render(v, replay_of(s, shown.account));
            EXPECT_TRUE(same_bytes(shown.image, again.image)) << k << " step " << int(shown.account.step);
            EXPECT_EQ(shown.account.passes, again.account.passes) << k;
            EXPECT_EQ(shown.account.standard_error, again.account.standard_error) << k;
        }
    }
}

TEST(BudgetFrame, StepsGoDownOneByOneAndEachShowsAWholeImage) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    using Step = FrameStep;
    for (const Method method : {Method::direct, Method::path}) {
        std::vector<Step> seen{Step::nothing};
        for (const double rays : ladder_of(v, method, 2)) {
            const Shown shown = render(renderer, v, rays_a_pixel(v, rays, 2, method));
            EXPECT_FALSE(is_worse(shown.account.step, seen.back())) << rays;  // more rays, no worse a step
            if (shown.account.step != seen.back()) seen.push_back(shown.account.step);
            if (shown.account.step == Step::nothing) {
                EXPECT_TRUE(is_untouched(shown.image)) << rays;
            } else {
                EXPECT_TRUE(is_whole(shown.image)) << rays;
            }
        }
        EXPECT_EQ(seen, method == Method::direct
                            ? (std::vector{Step::nothing, Step::coarse_4, Step::sparse, Step::refined})
                            : (std::vector{Step::nothing, Step::no_indirect, Step::coarse_4, Step::sparse,
                                           Step::refined}));
    }
}

TEST(BudgetFrame, WhatABodyHasLeftShowsTheBackground) {
    // The same renderer and image, and the body elsewhere: whatever it has covered is black again, at every step.
    BudgetView v = craft_over_a_globe();
    v.pose = looking({30, 0, 0}, {0, 0, 0});
    CameraRenderer renderer(v.render_scene, v.camera);
    RadianceImage image(v.camera.width, v.camera.height);
    for (const Method method : {Method::direct, Method::path})
        for (const double rays : {0.1, 0.4, 2.0, 4.0, 16.0, 40.0}) {
            v.at = placed(*v.scene);
            renderer.render(v.at, v.pose, rays_a_pixel(v, 4), image);
            v.at = placed(*v.scene, {0, 3, 9});
            const FrameSettings s = rays_a_pixel(v, rays, 1, method);
            const FrameAccount account = renderer.render(v.at, v.pose, s, image);
            ASSERT_NE(account.step, FrameStep::nothing);
            EXPECT_TRUE(same_bytes(image, render(v, s).image)) << rays;
        }
}

TEST(BudgetFrame, ADeadlineThatIsPastLeavesTimeForAWholeCoarseImage) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    for (const Method method : {Method::direct, Method::path}) {
        std::optional<RadianceImage> first;
        for (const std::int64_t late_ns : {std::int64_t{0}, std::int64_t{1'000'000}, now_ns()}) {
            FrameSettings s = rays_a_pixel(v, 0, 1, method);
            s.budget.kind = BudgetKind::time;
            s.budget.deadline_ns = now_ns() - late_ns;
            const Shown shown = render(renderer, v, s);
            EXPECT_EQ(shown.account.step, method == Method::direct ? FrameStep::coarse_4 : FrameStep::no_indirect);
            EXPECT_TRUE(is_whole(shown.image));
            if (!first) first = shown.image;
            EXPECT_TRUE(same_bytes(shown.image, *first));
        }
    }
}

TEST(BudgetFrame, WhatTheClockCutsOffLeavesNoTrace) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    constexpr int kRuns = 25;
    int frame = 0, cut = 0;
    for (const Method method : {Method::direct, Method::path}) {
        const std::int64_t begin_ns = now_ns();
        (void)render(renderer, v, rays_a_pixel(v, 4, static_cast<std::uint32_t>(++frame), method));
        const std::int64_t whole_ns =
            now_ns() - begin_ns;  // so that some deadline falls into a pass on any machine
        for (int run = 0; run < kRuns; ++run) {
            FrameSettings s = rays_a_pixel(v, 0, static_cast<std::uint32_t>(++frame), method);
            s.budget.kind = BudgetKind::time;
            s.budget.deadline_ns = now_ns() + whole_ns * (run + 1) / kRuns;
            const Shown shown = render(renderer, v, s);
            cut += shown.account.rays_discarded > 0;
            EXPECT_TRUE(is_whole(shown.image));
            EXPECT_TRUE(same_bytes(shown.image, render(v, replay_of(s, shown.account)).image)) << run;
        }
    }
    if (!HasFailure() && cut == 0) GTEST_SKIP() << "this machine finished every pass that it began";
}

TEST(BudgetFrame, HasNoSamplesOfSunlightAloneInTilesThatShowTheSunsDiscOnly) {
    BudgetView v = craft_over_a_globe();
    CameraRenderer kept(v.render_scene, v.camera);
    const FrameSettings s = rays_a_pixel(v, 60, 1, Method::path);
    EXPECT_GT(render(kept, v, s).account.passes[kSunlightPass], 0u);  // of other tiles
    const Vec3 to_sun = v.scene->sun->direction;
    const Vec3 eye = -8 * to_sun + 3.5 * normalized(cross(to_sun, {0, 0, 1}));
    v.pose = looking(eye, eye + to_sun);
    const Shown shown = render(kept, v, s);
    EXPECT_GT(shown.account.passes[kSunlightPass], 0u);
    EXPECT_GT(std::ranges::max(shown.image.pixels, {}, &Rgb::x).x, 1e5f) << "the Sun's disc";
    expect_the_same(shown, render(v, s));
    EXPECT_TRUE(same_bytes(shown.image, render(v, replay_of(s, shown.account)).image));
}

TEST(BudgetFrame, HasNoSamplesOfSunlightAloneWherePathsFindIt) {
    // Surfaces of smooth shading, whose sunlight is not apart, beside one that is flat and out of view.
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, icosphere(3, 2, true));
    add_sphere(s, 1, {0, 0, -90});
    add_sun(s, {0.5, -0.3, 1});
    const BudgetView v{std::move(s), 32, 24, 40, looking({7, 3, 5}, {0, 0, 0})};
    const FrameSettings settings = rays_a_pixel(v, 40, 1, Method::path);
    const Shown shown = render(v, settings);
    EXPECT_EQ(shown.account.passes[kSunlightPass], 0u);
    EXPECT_GE(static_cast<double>(shown.account.rays), 0.85 * static_cast<double>(settings.budget.rays));
    EXPECT_TRUE(same_bytes(shown.image, render(v, replay_of(settings, shown.account)).image));
}

TEST(BudgetFrame, HasNoSamplesOfSunlightAloneWherePathsTakeTheBudget) {
    // Within a box paths are long.
    Scene s;
    s.materials.push_back(lambert(0.9f));
    add_mesh(s, box(10, 10, 10));
    add_sun(s, {0.5, -0.3, 1});
    const BudgetView v{std::move(s), 32, 24, 40, looking({-4, 0.3, 0.2}, {0, 0, 0})};
    FrameSettings settings = rays_a_pixel(v, 20, 1, Method::path);
    settings.max_depth = 8;
    const Shown shown = render(v, settings);
    EXPECT_EQ(shown.account.passes[kSunlightPass], 0u);
    EXPECT_GE(static_cast<double>(shown.account.rays), 0.8 * static_cast<double>(settings.budget.rays));
    EXPECT_TRUE(same_bytes(shown.image, render(v, replay_of(settings, shown.account)).image));
}

TEST(BudgetFrame, HasSamplesOfSunlightAloneWhereTimeAllowsAndIsMadeAnewWithThem) {
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    const std::int64_t two_ns = ns_of_two_samples(renderer, v);
    bool any = false;
    // A busy machine may leave too little time: more each time.
    for (std::uint32_t frame = 0; frame < 12 && !any; ++frame) {
        FrameSettings s = rays_a_pixel(v, 0, frame, Method::path);
        s.budget.kind = BudgetKind::time;
        s.budget.deadline_ns = now_ns() + 8 * two_ns * (1 + std::int64_t{frame});
        const Shown shown = render(renderer, v, s);
        any = shown.account.passes[kSunlightPass] > 0;
        EXPECT_TRUE(same_bytes(shown.image, render(v, replay_of(s, shown.account)).image)) << frame;
    }
    EXPECT_TRUE(any);
}

TEST(BudgetFrame, AllocatesNothingAfterTheFirstFrame) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has the heap";
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    RadianceImage image(v.camera.width, v.camera.height);
    const auto frames = [&](std::uint32_t n) {
        for (std::uint32_t i = 0; i < n; ++i)
            for (const Method method : {Method::direct, Method::path})
                for (const double rays : {0.1, 2.0, 8.0, 30.0})
                    renderer.render(v.at, v.pose, rays_a_pixel(v, rays, i, method), image);
    };
    tbb::task_arena arena(2);
    arena.execute([&] { frames(10); });  // the thread pool and Embree settle
    const AllocationCounter count;
    arena.execute([&] { frames(10); });
    EXPECT_EQ(count.on_all_threads(), 0u);
}

TEST(BudgetFrame, TheFirstFrameThatDoesNotFitAllocatesNothing) {
    // In a run the machine may be overloaded for the first time at any moment.
    if (!kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has the heap";
    const BudgetView v = craft_over_a_globe();
    CameraRenderer renderer(v.render_scene, v.camera);
    RadianceImage image(v.camera.width, v.camera.height);
    tbb::task_arena arena(1);
    arena.execute([&] {
        for (std::uint32_t i = 0; i < 10; ++i) renderer.render(v.at, v.pose, rays_a_pixel(v, 30, i), image);
        const AllocationCounter count;
        const FrameAccount account = renderer.render(v.at, v.pose, rays_a_pixel(v, 0.3, 10), image);
        EXPECT_EQ(count.on_all_threads(), 0u);
        EXPECT_TRUE(is_filled(account.step));
    });
}

TEST(BudgetFrame, AnEmptyViewShowsTheBackgroundFromTheFirstTimedFrameOn) {
    BudgetView v = craft_over_a_globe();
    v.pose = looking({12, 7, 9}, {30, 20, 30});  // away from all bodies
    for (const Method method : {Method::direct, Method::path}) {
        FrameSettings s = rays_a_pixel(v, 0, 0, method);
        s.budget.kind = BudgetKind::time;
        s.budget.deadline_ns = now_ns() + 1'000'000'000;
        const Shown shown = render(v, s);
        EXPECT_TRUE(is_whole(shown.image));
        EXPECT_EQ(shown.account.standard_error, 0);
    }
}

}  // namespace
}  // namespace narpa
