// From a point of light to a body that the image resolves: the light goes on without a step.
#include <gtest/gtest.h>

#include "renderer/film/camera_image.h"
#include "tests/renderer/camera_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// What a Lambert sphere sends to a far camera under a point Sun, W m^-2.
double light_of_a_point(double albedo, double radius_m, double distance_m, double phase_rad) {
    return 1361 * 2 * albedo / (3 * kPi) * std::pow(radius_m / distance_m, 2) *
           (std::sin(phase_rad) + (kPi - phase_rad) * std::cos(phase_rad));
}

TEST(Handover, LightIsThatOfAPointFromATwentiethOfAPixelToFivePixels) {
    constexpr double kPhase = 0.9, kRadius_m = 5, kView_px = 1300;
    Scene scene;
    scene.materials.push_back(lambert(0.6f));
    add_sun(scene, {std::sin(kPhase), 0, -std::cos(kPhase)});
    scene.sun->angular_diameter_rad = 0;
    add_sphere(scene, kRadius_m, {});
    auto render_scene = RenderScene::create(scene, 1);
    ASSERT_TRUE(render_scene);
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> place(-0.5, 0.5);
    for (const auto& spread :
         {std::optional<PointSpreadFunction>{}, std::optional(PointSpreadFunction{.sigma_px = 0.8}),
          std::optional(PointSpreadFunction{.sigma_px = 0.3, .cutoff_per_px = 1.5})}) {
        Camera c = camera(81, 81, kView_px);
        c.point_spread = spread;
        CameraRenderer renderer(*render_scene, c);
        RadianceImage image(c.width, c.height);
        std::uint32_t frame = 0;
        // By steps of 10 %, and on both sides of two pixels, up to which subpixel bodies are sampled apart.
        std::vector<double> diameters_px{1.95, 1.99, 2.01, 2.05};
        for (double d = 0.05; d <= 5; d *= 1.1) diameters_px.push_back(d);
        for (const double diameter_px : diameters_px) {
            const double distance_m = 2 * kRadius_m * kView_px / diameter_px;
            BodyPoses at(1);
            at.set(0, {{},
                       {place(random) / kView_px * distance_m, place(random) / kView_px * distance_m, distance_m}});
            renderer.render(at, {}, {.spp = 256, .frame = frame++}, image);
            EXPECT_NEAR(irradiance(image, c) / light_of_a_point(0.6f, kRadius_m, distance_m, kPhase), 1, 0.01)
                << diameter_px << " px";
        }
    }
}

}  // namespace
}  // namespace narpa
