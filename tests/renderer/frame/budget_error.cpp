// Budgets and error: more rays, less error; the error that a frame estimates is the one that it has; nothing that a
// frame's own samples show biases it.
#include "renderer/frame/frame_passes.h"
#include "tests/renderer/frame/budget_support.h"

namespace narpa {
namespace {

using namespace test;
using Method = RenderSettings::Method;

/// Root mean squares over several frames: measured against the truth, and predicted by the frames themselves.
struct Errors {
    double measured = 0, predicted = 0;
};
Errors errors_of(const BudgetView& v, const std::vector<double>& truth, const FrameSettings& settings, int frames) {
    CameraRenderer renderer(v.render_scene, v.camera);
    Errors e;
    FrameSettings s = settings;
    for (int k = 0; k < frames; ++k) {
        s.frame = static_cast<std::uint32_t>(k);
        const Shown shown = render(renderer, v, s);
        e.measured += misses_of(shown.image, truth).squared / frames;
        e.predicted += shown.account.standard_error * shown.account.standard_error / frames;
        EXPECT_GE(shown.account.standard_error, 0);
    }
    return {std::sqrt(e.measured), std::sqrt(e.predicted)};
}

void expect_honest(const Errors& e, double least = 0.85) {
    EXPECT_GE(e.predicted, least * e.measured);
    EXPECT_LE(e.predicted, 1.40 * e.measured);
}

/// Straight edges of all directions and one contrast.
BudgetView tilted_boxes() {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    std::mt19937_64 random(5);
    for (int i = 0; i < 12; ++i)
        add_mesh(s, box(1.5, 1.5, 1.5), {random_attitude(random), Vec3{4.0 * (i % 4) - 6, 4.0 * (i / 4) - 4, 0}});
    add_sun(s, {0.3, 0.4, 1});
    return {std::move(s), 64, 48, 60, looking({0, 0, 15}, {0, 0, 0}, {0, 1, 0})};
}
/// Struts that taper from two pixels to nothing: details of all widths, of which the pixel centres miss some.
BudgetView tapering_struts() {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    std::mt19937_64 random(6);
    for (int i = 0; i < 24; ++i) {
        Mesh m;
        m.name = "strut";
        m.positions = {{0, -0.16f, 0}, {0, 0.16f, 0}, {3, 0, 0}};
        m.faces = {{0, 2, 1}};
        m.face_material = {0};
        std::uniform_real_distribution<double> turn(0, 2 * 3.14159265358979);
        const double angle = turn(random);
        add_mesh(s, std::move(m),
                 {normalized(Quat{std::cos(angle / 2), 0, 0, std::sin(angle / 2)}),
                  Vec3{2.6 * (i % 6) - 6.5, 2.6 * (i / 6) - 3.9, 0}});
    }
    add_sun(s, {0.1, 0.1, 1});
    return {std::move(s), 96, 72, 90, looking({0, 0, 15}, {0, 0, 0}, {0, 1, 0})};
}

TEST(BudgetError, EstimateIsHonestWhereEdgesAreStraight) {
    const BudgetView v = tilted_boxes();
    const std::vector<double> truth = truth_of(v, 2048);
    for (const int spp : {1, 2, 4, 16}) {
        SCOPED_TRACE(spp);
        expect_honest(errors_of(v, truth, samples_a_pixel(v, spp), 4));
    }
    for (const double rays : {2.0, 4.0, 8.0, 16.0}) {
        SCOPED_TRACE(rays);
        expect_honest(errors_of(v, truth, rays_a_pixel(v, rays), 4));
    }
}

/// 2 px of blur, and as much shear by a rolling shutter. At 4 rays a pixel the prediction is a fifth too small.
TEST(BudgetError, EstimateIsHonestWhereTheCameraMoves) {
    BudgetView v = tilted_boxes();
    v.pose = {looking({-0.5, 0, 15}, {-0.5, 0.1, 0}, {0, 1, 0}), looking({0.5, 0, 15}, {0.5, 0, 0}, {0, 1, 0}),
              0.5 / 47};
    const std::vector<double> truth = truth_of(v, 1024);
    for (const int spp : {2, 4, 16}) {
        SCOPED_TRACE(spp);
        expect_honest(errors_of(v, truth, samples_a_pixel(v, spp), 4));
    }
    for (const double rays : {4.0, 8.0, 16.0}) {
        SCOPED_TRACE(rays);
        expect_honest(errors_of(v, truth, rays_a_pixel(v, rays), 4), 0.75);
    }
}

TEST(BudgetError, EstimateIsHonestWhereDetailsAreFinerThanPixels) {
    for (const BudgetView& v : {tapering_struts(), craft_over_a_globe()}) {
        const std::vector<double> truth = truth_of(v, 2048);
        for (const int spp : {1, 4, 16}) {
            SCOPED_TRACE(spp);
            expect_honest(errors_of(v, truth, samples_a_pixel(v, spp), 4));
        }
        for (const double rays : {2.0, 4.0, 8.0, 16.0}) {
            SCOPED_TRACE(rays);
            expect_honest(errors_of(v, truth, rays_a_pixel(v, rays), 4));
        }
    }
}

TEST(BudgetError, EstimateIsHonestWherePathsMakeNoise) {
    const BudgetView v = craft_over_a_globe(36, 26);
    const std::vector<double> truth = truth_of(v, 1024, Method::path);
    for (const int spp : {1, 4, 16}) {
        SCOPED_TRACE(spp);
        expect_honest(errors_of(v, truth, samples_a_pixel(v, spp, 0, Method::path), 6));
    }
    for (const double rays : {8.0, 16.0, 32.0}) {
        SCOPED_TRACE(rays);
        expect_honest(errors_of(v, truth, rays_a_pixel(v, rays, 0, Method::path), 6));
    }
}

TEST(BudgetError, SamplesOfSunlightAloneReduceItWherePathsOnlyAddToSunlight) {
    const BudgetView v = craft_over_a_globe();
    const std::vector<double> truth = truth_of(v, 1024, Method::path);
    for (const double rays : {8.0, 32.0}) {
        FrameSettings with = rays_a_pixel(v, rays, 0, Method::path), without = with;
        without.mechanisms.sample_plan = false;
        const bool planned = render(v, with).account.passes[kSunlightPass] > 0;
        EXPECT_EQ(planned, rays > 20);
        EXPECT_EQ(render(v, without).account.passes[kSunlightPass], 0u);
        if (!planned) continue;
        const Errors e = errors_of(v, truth, with, 6);
        expect_honest(e);
        EXPECT_LT(e.measured, 0.95 * errors_of(v, truth, without, 6).measured);
    }
}

TEST(BudgetError, IsNotEstimatedWhereLightIsLeftOut) {
    const BudgetView v = craft_over_a_globe();
    for (const FrameStep step : {FrameStep::no_indirect, FrameStep::nothing}) {
        FrameAccount account;
        account.step = step;
        EXPECT_LT(render(v, replay_of(rays_a_pixel(v, 0, 1, Method::path), account)).account.standard_error, 0);
    }
}

TEST(BudgetError, FallsAsTheBudgetGrows) {
    const BudgetView v = craft_over_a_globe(60, 43);
    for (const Method method : {Method::direct, Method::path}) {
        const std::vector<double> truth = truth_of(v, method == Method::path ? 512 : 2048, method);
        const std::vector<double> budgets = method == Method::direct ? std::vector<double>{0.1, 0.6, 2, 4, 8, 16}
                                                                     : std::vector<double>{0.1, 4, 8, 16, 32};
        double before = 1e9;
        for (const double rays : budgets) {
            CameraRenderer renderer(v.render_scene, v.camera);
            double squared = 0;
            for (std::uint32_t k = 0; k < 2; ++k)
                squared +=
                    misses_of(render(renderer, v, rays_a_pixel(v, rays, k, method)).image, truth).squared / 2;
            // Twice the rays take away a fifth of the error at least.
            EXPECT_LT(std::sqrt(squared), 0.8 * before) << rays;
            before = std::sqrt(squared);
        }
    }
}

/// A floor of many bodies, edge to edge, under a sky that a grid of slats nearly hides: one path in sixteen finds
/// it. The light is smooth over every pixel, so that a centre is as good a sample as any and nothing but a bias
/// remains in the mean of many frames; and the edges are of no contrast but that of the noise.
BudgetView slatted_court() {
    Scene s;
    s.materials.push_back(lambert(0.8f));
    for (int y = 0; y < 12; ++y)
        for (int x = 0; x < 16; ++x) add_mesh(s, plate(0.5, 0.5), {Quat{}, {0.5 * x - 4, 0.5 * y - 3, 0}});
    for (int x = -10; x <= 10; ++x) add_mesh(s, plate(0.94, 40), {Quat{0, 1, 0, 0}, {1.0 * x, 0, 4}});
    s.ambient = {10, 10, 10};
    return {std::move(s), 20, 15, 16, looking({0.1, 0.1, 3.5}, {0, 0, 0}, {0, 1, 0})};
}

/// Mean error of frames, one after another.
class Bias {
public:
    void add(double miss) { ++n_, sum_ += miss, squares_ += miss * miss; }
    [[nodiscard]] int frames() const { return n_; }
    [[nodiscard]] double mean() const { return sum_ / n_; }
    [[nodiscard]] double sigma() const { return std::sqrt((squares_ / n_ - mean() * mean()) / (n_ - 1)); }
    [[nodiscard]] double in_sigmas() const { return mean() / sigma(); }

private:
    int n_ = 0;
    double sum_ = 0, squares_ = 0;
};

// Samples that are chosen by samples that count have another mean (math.md H20, H21): frames of paths choose none.
TEST(BudgetError, FramesOfPathsHaveTheMeanOfTheReference) {
    const BudgetView v = slatted_court();
    // Four times as many samples as eighty frames': what is not known of the mean grows by 12 %.
    const std::vector<double> truth = truth_of(v, 512, Method::path);
    CameraRenderer renderer(v.render_scene, v.camera);
    for (const double rays : {14.0, 20.0}) {
        Bias bias;
        for (std::uint32_t k = 0; k < 80; ++k) {
            const Shown shown = render(renderer, v, rays_a_pixel(v, rays, k, Method::path));
            ASSERT_LE(shown.account.step, FrameStep::one_sample);
            bias.add(misses_of(shown.image, truth).mean);
        }
        EXPECT_LT(std::abs(bias.mean()), 4 * 1.12 * bias.sigma()) << rays;
    }
}

TEST(BudgetError, FramesWithSamplesOfSunlightAloneHaveTheMeanOfTheReference) {
    const BudgetView v = craft_over_a_globe(36, 26);
    const std::vector<double> truth = truth_of(v, 2048, Method::path);
    CameraRenderer renderer(v.render_scene, v.camera);
    Bias bias;
    for (std::uint32_t k = 0; k < 80; ++k) {
        const Shown shown = render(renderer, v, rays_a_pixel(v, 30, k, Method::path));
        ASSERT_GT(shown.account.passes[kSunlightPass], 0u);
        bias.add(misses_of(shown.image, truth).mean);
    }
    EXPECT_LT(std::abs(bias.mean()), 4 * 1.12 * bias.sigma());
}

/// A room whose lamps, in view, are a hundred times brighter than its walls.
BudgetView lamps_in_a_room() {
    Scene s;
    s.materials.push_back(lambert(0.7f));
    Material lamp = lambert(0.2f);
    lamp.emission = {60, 55, 50};
    s.materials.push_back(lamp);
    add_mesh(s, plate(8, 8));                                                       // floor
    add_mesh(s, plate(8, 8), {exp_rotation({3.14159265358979, 0, 0}), {0, 0, 4}});  // ceiling
    add_mesh(s, plate(8, 4), {exp_rotation({1.5707963267949, 0, 0}), {0, 4, 2}});   // wall ahead
    add_mesh(s, box(1.2, 1.2, 2.4), {normalized(Quat{1, 0, 0, 0.3}), {-1.3, 1.5, 1.2}});
    add_mesh(s, box(0.1, 0.1, 3.5), {Quat{}, {0.6, 0.5, 1.9}});
    for (int k = 0; k < 6; ++k) {
        Mesh panel = plate(0.35, 0.2);
        panel.face_material.assign(panel.faces.size(), 1);
        add_mesh(s, std::move(panel),
                 {exp_rotation({2.2, 0, 0.1 * k}), {1.1 * (k % 3) - 1.2, 1.0 + 1.3 * (k / 3), 3.6 - 0.1 * k}});
    }
    return {std::move(s), 56, 40, 50, looking({0.2, -3.5, 1.8}, {0, 1, 1.8})};
}

TEST(BudgetError, FallsAsTheBudgetGrowsWhereLampsAreInView) {
    const BudgetView v = lamps_in_a_room();
    const std::vector<double> truth = truth_of(v, 1024, Method::path);
    const double rays_of_sample =
        static_cast<double>(render(v, samples_a_pixel(v, 8, 0, Method::path)).account.rays) /
        static_cast<double>(8 * v.pixels());
    double before = 1e9;
    int with_emission = 0;
    for (const double rays : {2.0, 4.0, 8.0, 16.0, 32.0, 64.0}) {
        SCOPED_TRACE(rays);
        const FrameSettings settings = rays_a_pixel(v, rays, 0, Method::path);
        const FrameAccount account = render(v, settings).account;
        const Errors e = errors_of(v, truth, settings, 6);
        EXPECT_LT(e.measured, before);
        before = e.measured;
        if (account.passes[kSunlightPass] == 0) continue;
        ++with_emission;
        expect_honest(e);
        const int spp = static_cast<int>(rays / rays_of_sample);
        EXPECT_LT(e.measured, 0.5 * errors_of(v, truth, samples_a_pixel(v, spp, 0, Method::path), 6).measured);
    }
    EXPECT_GE(with_emission, 2);
}

TEST(BudgetError, FramesWhereLampsAreInViewAreTheSameOnAnyThreadsAndFromTheirAccount) {
    const BudgetView v = lamps_in_a_room();
    int with_emission = 0;
    for (const double rays : {1.0, 3.0, 8.0, 16.0, 20.0, 29.0, 64.0}) {
        SCOPED_TRACE(rays);
        const FrameSettings s = rays_a_pixel(v, rays, 3, Method::path);
        const Shown shown = render(v, s);
        EXPECT_LE(shown.account.rays + shown.account.rays_discarded, s.budget.rays);
        const Shown alone = tbb::task_arena(1).execute([&] { return render(v, s); });
        EXPECT_TRUE(same_bytes(shown.image, alone.image));
        EXPECT_EQ(shown.account.standard_error, alone.account.standard_error);
        const Shown again = render(v, replay_of(s, shown.account));
        EXPECT_TRUE(same_bytes(shown.image, again.image));
        EXPECT_EQ(again.account.passes, shown.account.passes);
        if (shown.account.passes[kSunlightPass] > 0) ++with_emission;
    }
    EXPECT_GE(with_emission, 2);
}

TEST(BudgetError, FramesWithSamplesOfEmissionAloneHaveTheMeanOfTheReference) {
    const BudgetView v = lamps_in_a_room();
    const std::vector<double> truth = truth_of(v, 2048, Method::path);
    CameraRenderer renderer(v.render_scene, v.camera);
    Bias bias;
    for (std::uint32_t k = 0; k < 80; ++k) {
        const Shown shown = render(renderer, v, rays_a_pixel(v, 24, k, Method::path));
        ASSERT_GT(shown.account.passes[kSunlightPass], 0u);
        bias.add(misses_of(shown.image, truth).mean);
    }
    EXPECT_LT(std::abs(bias.mean()), 4 * 1.12 * bias.sigma());
}

TEST(BudgetError, FramesThatTheClockEndsHaveTheMeanOfTheReference) {
    const BudgetView v = slatted_court();
    const std::vector<double> truth = truth_of(v, 512, Method::path);
    CameraRenderer renderer(v.render_scene, v.camera);
    const std::int64_t two_ns = ns_of_two_samples(renderer, v);
    Bias bias;
    for (std::uint32_t k = 0; k < 60; ++k) {
        FrameSettings s = rays_a_pixel(v, 0, k, Method::path);
        s.budget.kind = BudgetKind::time;
        s.budget.deadline_ns = now_ns() + two_ns * (100 + 8 * std::int64_t{k}) / 100;  // 1 to 5.7 times
        const Shown shown = render(renderer, v, s);
        if (shown.account.step <= FrameStep::one_sample) bias.add(misses_of(shown.image, truth).mean);
    }
    if (bias.frames() < 30) GTEST_SKIP() << "the machine is too busy";
    EXPECT_LT(std::abs(bias.in_sigmas()), 5);  // once in a million, as the clock chooses anew each time
}

}  // namespace
}  // namespace narpa
