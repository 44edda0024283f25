// The random numbers of a scene's cameras.
#include <gtest/gtest.h>

#include <cmath>

#include "emulator/camera/camera_unit.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

/// Two cameras at one place, of black space, with all noise.
Scene stereo_pair() {
    Scene scene;
    Camera camera;
    camera.width = 96, camera.height = 64;
    test::set_pinhole(camera, 100, 100, 47.5, 31.5);
    camera.format = PixelFormat::y16;
    Detector d;
    d.shot_noise = true, d.read_noise_e = 50, d.black_level_dn = 200, d.exposure_s = 1e-3;
    camera.detector = d;
    for (const char* name : {"left", "right"}) {
        camera.name = name;
        scene.cameras.push_back(camera);
    }
    return scene;
}

std::vector<double> pixels(const Scene& scene, std::size_t index) {
    auto world = World::create(scene);
    EXPECT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, index);
    (void)unit.expose(3, 300'000'000);
    std::vector<double> out;
    for (std::size_t i = 0; i + 1 < unit.bytes().size(); i += 2)
        out.push_back(unit.bytes()[i] + 256.0 * unit.bytes()[i + 1]);
    return out;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
    const auto n = static_cast<double>(a.size());
    double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        sum_a += a[i], sum_b += b[i], aa += a[i] * a[i], bb += b[i] * b[i], ab += a[i] * b[i];
    return (ab - sum_a * sum_b / n) / std::sqrt((aa - sum_a * sum_a / n) * (bb - sum_b * sum_b / n));
}

TEST(CameraNoise, IsAnotherInEachCameraOfAScene) {
    const Scene scene = stereo_pair();
    const std::vector<double> left = pixels(scene, 0), right = pixels(scene, 1);
    EXPECT_EQ(left, pixels(scene, 0));
    EXPECT_EQ(right, pixels(scene, 1));
    EXPECT_NEAR(correlation(left, right), 0, 5 / std::sqrt(96 * 64));  // five standard deviations
}

/// A single sample would be in the middle of the pixel.
TEST(CameraNoise, SamplesAreOthersInEachCameraOfAScene) {
    Scene scene = stereo_pair();
    for (Camera& camera : scene.cameras) camera.detector.reset(), camera.white_radiance = 500;
    test::add_sun(scene, {1, 0, -1}, 1361);
    scene.materials.push_back(test::lambert(0.5F));
    test::add_sphere(scene, 1, {0, 0, 5});
    scene.render.spp = 2;
    const std::vector<double> left = pixels(scene, 0), right = pixels(scene, 1);
    EXPECT_EQ(left, pixels(scene, 0));
    EXPECT_NE(left, right);
    EXPECT_GT(correlation(left, right), 0.9);  // of the same ball
}

}  // namespace
}  // namespace narpa
