// The ghost of the Sun: its light, its place, and what hides it.
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/camera/scene_camera.h"
#include "renderer/optics/sun_ghost.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using namespace test;

constexpr int kGhostSide = 200;
constexpr double kIrradiance = 1361, kStrength = 1e-4;

/// The Sun at an angle (radians) to the right of the axis and below it, and a ball far behind the camera.
Scene sun_at(double right, double below) {
    Scene scene;
    add_sun(scene, {std::tan(right), std::tan(below), 1}, kIrradiance);
    scene.materials.push_back(lambert(0.5f));
    add_sphere(scene, 1, {0, 0, -100});
    return scene;
}

Camera with_ghost(double radius_px = 20, double scale = 1, double strength = kStrength) {
    Camera c = camera(kGhostSide, kGhostSide, 300);
    c.optics.effects = {
        sun_ghost({.strength = strength, .radius_px = radius_px, .scale = scale, .within_rad = 0.5})};
    return c;
}

/// Light-weighted mean position; z: the sum of radiance.
Vec3 centroid_and_light(const RadianceImage& image) {
    Vec3 sum;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const auto light = static_cast<double>(image.pixels[static_cast<std::size_t>(y * image.width + x)].y);
            sum = sum + light * Vec3{static_cast<double>(x), static_cast<double>(y), 1};
        }
    return sum.z > 0 ? Vec3{sum.x / sum.z, sum.y / sum.z, sum.z} : Vec3{};
}

TEST(SunGhost, HasItsShareOfTheSunsLight) {
    const double right = 0.12, below = -0.05;
    for (const double radius_px : {1.0, 1.7, 5.0, 20.5, 40.0}) {
        const Camera c = with_ghost(radius_px);
        const double light =
            centroid_and_light(rendered(sun_at(right, below), c)).z / (pinhole_of(c).fx * pinhole_of(c).fy);
        const double cosine = sun_at(right, below).sun->direction.z;
        EXPECT_NEAR(light / (kStrength * kIrradiance * cosine), 1, radius_px < 2 ? 0.04 : 0.005) << radius_px;
    }
}

TEST(SunGhost, IsEvenlyLit) {
    const Camera c = with_ghost(20);
    const RadianceImage image = rendered(sun_at(0, 0), c);
    const auto at = [&](int x, int y) { return image.pixels[static_cast<std::size_t>(y * kGhostSide + x)].y; };
    EXPECT_GT(at(100, 100), 0);
    EXPECT_EQ(at(100, 100), at(113, 110));
    EXPECT_EQ(at(100, 100), at(100, 82));
    EXPECT_EQ(at(100, 100 - 22), 0);
    EXPECT_EQ(at(100 + 15, 100 + 15), 0);
}

void expect_opposite_the_sun(const Camera& c, double scale, double right, double below) {
    const CameraModel& model = *c.model;
    const Scene scene = sun_at(right, below);
    const auto sun = model.project(scene.sun->direction), axis = model.project({0, 0, 1});
    ASSERT_TRUE(sun && axis);
    const Vec3 at = centroid_and_light(rendered(scene, c));
    EXPECT_NEAR(at.x, axis->x - scale * (sun->x - axis->x), 0.01);
    EXPECT_NEAR(at.y, axis->y - scale * (sun->y - axis->y), 0.01);
}

TEST(SunGhost, StandsOppositeTheSunsImage) {
    const auto expect = [](double scale, double right, double below) {
        Camera c = with_ghost(20, scale);
        set_principal_point(c, 91.3, 104);
        expect_opposite_the_sun(c, scale, right, below);
    };
    expect(1, 0.12, -0.07);
    expect(0.4, 0.12, -0.07);
    expect(0.4, 0.45, 0.1);     // the Sun beyond the image
    expect(-0.5, 0.12, -0.07);  // on the Sun's side
}

TEST(SunGhost, GoesWithTheDistortedImage) {
    Camera c = with_ghost(15, 0.8);
    c.model = brown_conrady(pinhole_of(c), {-0.3, 0.1, 0.01, -0.02});
    expect_opposite_the_sun(c, 0.8, 0.25, -0.2);
    c.model = kannala_brandt(pinhole_of(c), {0.1, -0.05, 0.02, 0});
    expect_opposite_the_sun(c, 0.8, 0.25, -0.2);
}

TEST(SunGhost, IsGoneBehindABodyAndBeyondItsAngle) {
    const auto light = [](const Scene& scene) {
        return centroid_and_light(rendered(scene, with_ghost(20, 0.3))).z;
    };
    // In the last tenth it fades evenly.
    const double whole = light(sun_at(0.4499, 0)) / std::cos(0.4499);
    EXPECT_NEAR(light(sun_at(0.475, 0)) / std::cos(0.475), 0.5 * whole, 0.01 * whole);
    EXPECT_LT(light(sun_at(0.4999, 0)), 0.01 * whole);
    EXPECT_EQ(light(sun_at(0.51, 0)), 0);
    Scene behind = sun_at(0, 0);
    behind.sun->direction = {0, 0, -1};
    EXPECT_EQ(light(behind), 0);
    Scene hidden = sun_at(0.4, 0);  // the ball is outside the image
    EXPECT_GT(light(hidden), 0);
    hidden.bodies[0].initial.T_world_body.t = 50 * hidden.sun->direction;
    EXPECT_EQ(light(hidden), 0);
    hidden.bodies[0].initial.T_world_body.t = 50 * hidden.sun->direction + Vec3{0, 1.01, 0};
    EXPECT_GT(light(hidden), 0);
}

TEST(SunGhost, TakesEachRowOfARollingShutterInTurn) {
    const Camera c = with_ghost(60);
    const auto turned = [](double angle) { return Rigid3{exp_rotation({0, angle, 0}), {}}; };
    const RadianceImage image = rendered(sun_at(0, 0), c, {turned(-0.1), turned(0.1), 1.0 / (kGhostSide - 1)});
    const CameraModel& model = *c.model;
    for (const int y : {60, 100, 140}) {
        double sum = 0, x_sum = 0;
        for (int x = 0; x < kGhostSide; ++x) {
            const auto light = static_cast<double>(image.pixels[static_cast<std::size_t>(y * kGhostSide + x)].y);
            sum += light, x_sum += light * x;
        }
        const double angle = -0.1 + 0.2 * y / (kGhostSide - 1.0);
        const auto sun = model.project({std::sin(-angle), 0, std::cos(angle)});
        EXPECT_NEAR(x_sum / sum, 2 * pinhole_of(c).cx - sun->x, 0.02) << "row " << y;
    }
}

TEST(SunGhost, LeavesTheImageBelowItAsItWas) {
    Scene scene = sun_at(0.1, 0);
    scene.bodies[0].initial.T_world_body.t = {0, 3, 30};
    Camera plain = with_ghost();
    plain.optics.effects.clear();
    const RadianceImage without = rendered(scene, plain), with = rendered(scene, with_ghost(200));
    const float added = with.pixels[0].y - without.pixels[0].y;
    EXPECT_GT(added, 0);
    for (std::size_t i = 0; i < with.pixels.size(); ++i)
        EXPECT_NEAR(with.pixels[i].y - without.pixels[i].y, added, 1e-4f * with.pixels[i].y);
}

TEST(SunGhost, IsDimmedByTheAir) {
    // From the ground, the Sun 75 degrees from the zenith.
    const double z = 75 * kPi / 180;
    Scene scene = sun_at(0, 0);
    scene.bodies.clear();
    add_sphere(scene, 6'371'000, -6'371'002 * Vec3{std::sin(z), 0, std::cos(z)});
    const Camera ghost = with_ghost(20, 1, 1);
    Camera plain = ghost;
    plain.optics.effects.clear();
    const auto added = [&](const RenderScene& render_scene) {
        const std::size_t middle = kGhostSide * kGhostSide / 2 + kGhostSide / 2;
        const BodyPoses at = placed(scene);
        return rendered(render_scene, at, ghost).pixels[middle] - rendered(render_scene, at, plain).pixels[middle];
    };
    const Rgb vacuum = added(*RenderScene::create(scene, 1));
    scene.atmosphere = coarse_earth_air();
    const auto render_scene = RenderScene::create(scene, 2);
    ASSERT_TRUE(render_scene);
    const Rgb expected = render_scene->medium()->transmittance(placed(scene), {{}, {0, 0, 1}}, kInfinity);
    EXPECT_LT(expected.z, 0.5f);
    const Rgb through = added(*render_scene);
    for (int band = 0; band < 3; ++band)
        EXPECT_NEAR(through[band] / vacuum[band], expected[band], 1e-3f * expected[band]);
}

}  // namespace
}  // namespace narpa
