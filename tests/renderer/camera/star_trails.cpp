// Stars through an exposure: trails by camera and world frame that turn, by row, and past moving bodies.
#include "tests/renderer/camera/star_support.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kTrailFocal_px = 1000;

Camera trail_camera(const std::optional<PointSpreadFunction>& spread) {
    Camera c = camera(121, 61, kTrailFocal_px);
    c.optics.point_spread = spread;
    return c;
}

TEST(StarTrails, AreAsLongAsTheTurnAndEven) {
    for (const auto& spread :
         {std::optional<PointSpreadFunction>{}, std::optional(PointSpreadFunction{.sigma_px = 0.15}),
          std::optional(PointSpreadFunction{.sigma_px = 0.8})}) {
        const Camera c = trail_camera(spread);
        const Scene scene = sky({{0, 0, 1}});
        const Spot still = spot_in(rendered(scene, c));
        constexpr double kLength_px = 50;
        const RadianceImage image =
            rendered(scene, c, turning({0, 2 * std::atan(0.5 * kLength_px / kTrailFocal_px), 0}));
        const Spot trail = spot_in(image);
        EXPECT_NEAR(trail.sum / still.sum, 1, 1e-3);
        EXPECT_NEAR(trail.x, 60, 0.01);
        EXPECT_NEAR(trail.y, 30, 0.01);
        for (int x = 40; x <= 80; ++x)  // a pixel takes 1 / length of it
            EXPECT_NEAR(spot_in(image, x, x + 1).sum / still.sum * kLength_px, 1, 0.005) << "column " << x;
        EXPECT_NEAR(spot_in(image, 35, 86).sum / still.sum, 1, spread ? 0.02 : 0.001);
    }
}

TEST(StarTrails, ComeFromTheWorldFrameThatTurns) {
    const Camera c = trail_camera(PointSpreadFunction{.sigma_px = 0.6});
    Scene scene = sky({{0, 0, 1}});
    scene.stars->rate_rad_s = {0, 1e-2, 0};
    CameraPose pose{{}, {}};
    pose.set_clock(-1, 1, {});
    const RadianceImage image = rendered(scene, c, pose);
    const Spot still = spot_in(rendered(scene, c));
    EXPECT_NEAR(spot_in(image).sum / still.sum, 1, 1e-3);
    EXPECT_NEAR(spot_in(image).x, 60, 0.01);
    for (int x = 52; x <= 68; ++x) EXPECT_NEAR(spot_in(image, x, x + 1).sum / still.sum * 20, 1, 0.005);
}

/// Each row sees the trail of its own time: the camera turns to the right, so that stars go left.
TEST(StarTrails, RollingShutterSkewsTheSky) {
    const Camera c = trail_camera(PointSpreadFunction{.sigma_px = 0.6});
    constexpr double kTurn_px = 20, kRowTime = 0.8 / 60;  // each row is exposed for a fifth of the time
    for (const double row : {10.3, 30.0, 44.8}) {
        const Scene scene = sky({{0, (row - 30) / kTrailFocal_px, 1}});
        const Spot still = spot_in(rendered(scene, c));
        const CameraPose pose = turning({0, kTurn_px / kTrailFocal_px, 0}, kRowTime);
        const RadianceImage image = rendered(scene, c, pose);
        EXPECT_NEAR(spot_in(image).sum / still.sum, 1, 0.001);
        for (int y = static_cast<int>(row) - 1; y <= static_cast<int>(row) + 2; ++y) {
            const Spot line = spot_in(image, 0, 121, y, y + 1);
            EXPECT_NEAR(line.x, 60 - kTurn_px * (pose.time(y, 61, 0.5) - 0.5), 0.01) << "row " << y;
        }
    }
}

TEST(StarTrails, OfWildTurnsAreFinite) {
    const Camera c = trail_camera(std::nullopt);
    std::mt19937_64 random(8);
    std::vector<Vec3> directions;
    for (int i = 0; i < 20; ++i) directions.push_back(random_direction(random));
    Scene scene = sky(directions);
    CameraPose pose{{}, {exp_rotation({0, 3, 0}), {}}, 1.0 / 60};
    pose.set_clock(0, 1, {1e30, 0, 0});
    scene.stars->rate_rad_s = {900, -1000, 800};
    for (const Rgb& v : rendered(scene, c, pose).pixels) ASSERT_TRUE(is_finite(v) && v.x >= 0);
}

TEST(StarTrails, EndWhereABodyComesBefore) {
    Scene scene = sky({{0, 0, 1}});
    scene.materials.push_back(lambert(0.5f));
    add_sphere(scene, 2, {0, 0, 100});
    const Camera c = trail_camera(PointSpreadFunction{.sigma_px = 0.6});
    BodyPoses at(1);
    // Its edge reaches the star after a quarter of the exposure.
    at.set(0, {{}, {-3, 0, 100}}, {{}, {1, 0, 100}});
    const CameraPose pose{{}, {}};
    const Spot part = spot_in(rendered(scene, at, c, pose));
    scene.bodies.clear();
    EXPECT_NEAR(part.sum / spot_in(rendered(scene, c)).sum, 0.25, 0.04);
}

}  // namespace
}  // namespace narpa
