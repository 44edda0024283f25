// Exposure in time: what moves is blurred about its place at mid-exposure, and each row has its own time.
#include <gtest/gtest.h>

#include "emulator/camera/camera_unit.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kPxPerS = 40;

/// A glowing ball of 3 px radius that crosses the image of a camera at rest to the right; at t = 0 in its middle
/// column, `rows_below` its middle row.
Scene passing_ball(const std::optional<Shutter>& shutter, double exposure_s, double rows_below) {
    Scene scene;
    Material glow = lambert(0);
    glow.emission = {1, 1, 1};
    scene.materials.push_back(glow);
    add_sphere(scene, 1.5, {0, 0.5 * rows_below, 50});
    scene.bodies[0].name = "ball";
    scene.bodies[0].initial.T_world_body.t = {0, 0.5 * rows_below, 50};
    scene.bodies[0].initial.velocity_m_s = {0.5 * kPxPerS, 0, 0};
    Camera c = camera(96, 49, 100);
    c.detector = Detector{.exposure_s = exposure_s};
    c.shutter = shutter;
    scene.cameras.push_back(c);
    scene.render.spp = 256;
    return scene;
}

struct Seen {
    double x = 0, width_px = 0;  ///< centroid; standard deviation along x
};
Seen seen(const Scene& scene, std::int64_t t_mid_ns = 0) {
    auto world = World::create(scene);
    EXPECT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, 0);
    (void)unit.expose(0, t_mid_ns);
    double sum = 0, x = 0, xx = 0;
    for (int j = 0; j < 49; ++j)
        for (int i = 0; i < 96; ++i) {
            const double v = static_cast<double>(unit.radiance().pixels[static_cast<std::size_t>(j * 96 + i)].y);
            sum += v, x += v * i, xx += v * i * i;
        }
    return {x / sum, std::sqrt(xx / sum - x * x / (sum * sum))};
}

TEST(Shutter, WithoutOneAFrameIsAMoment) {
    const Seen still = seen(passing_ball(std::nullopt, 0.05, 0));
    EXPECT_NEAR(still.x, 47.5, 0.01);
    EXPECT_NEAR(still.width_px, std::sqrt(9.0 / 4 + 1.0 / 12), 0.02);  // a disc of 3 px, and the pixel
}

TEST(Shutter, GlobalBlursAboutThePlaceAtMidExposure) {
    const Seen blurred = seen(passing_ball(Shutter{}, 0.05, 0), 100'000'000);
    EXPECT_NEAR(blurred.x, 47.5 + 0.1 * kPxPerS, 0.01);
    const double run = kPxPerS * 0.05;
    EXPECT_NEAR(blurred.width_px, std::sqrt(9.0 / 4 + 1.0 / 12 + run * run / 12), 0.02);
}

TEST(Shutter, RollingTakesEachRowAtItsOwnTime) {
    constexpr double kRowTime_s = 1e-3;
    for (const double row : {-15.0, 0.0, 15.0})
        EXPECT_NEAR(seen(passing_ball(Shutter{1'000'000}, 0.01, row)).x, 47.5 + kPxPerS * row * kRowTime_s, 0.01);
}

TEST(Shutter, LedgerHasTheExposureOfTheWholeImage) {
    auto world = World::create(passing_ball(Shutter{1'000'000}, 0.01, 0));
    ASSERT_TRUE(world);
    CameraUnit unit(**world, 0);
    const FrameLedger l = unit.expose(0, 1'000'000'000);
    EXPECT_EQ(l.t_exposure_mid_ns, 1'000'000'000);
    EXPECT_EQ(l.t_exposure_start_ns, 971'000'000);
    EXPECT_EQ(l.t_exposure_end_ns, 1'029'000'000);
    ASSERT_EQ(unit.motions_at_end().size(), 1u);
    EXPECT_NEAR(unit.motions_at_end()[0].T_world_body.t.x, 0.5 * kPxPerS * 1.029, 1e-12);
}

}  // namespace
}  // namespace narpa
