// From a point of light to a body that the image resolves: the light goes on without a step.
#include <gtest/gtest.h>

#include "renderer/camera/scene_camera.h"
#include "renderer/frame/camera_image.h"
#include "renderer/optics/point_response.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/cameras.h"
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
        c.optics.point_spread = spread;
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

struct LightSpread {
    PointSpreadFunction function;
    double form;  ///< largest difference from a star, in units of the star's brightest pixel; measured: 85 % of it
};
const std::array kSpreads{LightSpread{{.sigma_px = 0.3}, 0.33}, LightSpread{{.sigma_px = 0.5}, 0.2},
                          LightSpread{{.sigma_px = 0.8}, 0.065}, LightSpread{{.sigma_px = 1.5}, 0.013},
                          LightSpread{{.sigma_px = 0.3, .cutoff_per_px = 1.5}, 0.23}};

/// Brightness and its centroid.
struct LightSpot {
    double light = 0, x = 0, y = 0;
};
LightSpot blob(const RadianceImage& image) {
    LightSpot b;
    for (int v = 0; v < image.height; ++v)
        for (int u = 0; u < image.width; ++u) {
            const auto l = static_cast<double>(image.pixels[static_cast<std::size_t>(v * image.width + u)].y);
            b.light += l, b.x += u * l, b.y += v * l;
        }
    b.x /= b.light, b.y /= b.light;
    return b;
}

/// Largest difference from the image of a star with this light, over the star's brightest pixel.
double difference_from_star(const RadianceImage& image, const PointResponse& response, const LightSpot& star) {
    double brightest = 0, worst = 0;
    std::vector<Rgb> row;
    for (int v = 0; v < image.height; ++v) {
        row.assign(static_cast<std::size_t>(image.width), {});
        response.add(star.x, star.y, static_cast<float>(star.light) * Rgb{1, 1, 1}, v, image.width, row.data());
        for (int u = 0; u < image.width; ++u) {
            const auto expected = static_cast<double>(row[static_cast<std::size_t>(u)].y);
            const Rgb& seen = image.pixels[static_cast<std::size_t>(v * image.width + u)];
            brightest = std::max(brightest, expected);
            worst = std::max(worst, std::abs(static_cast<double>(seen.y) - expected));
        }
    }
    return worst / brightest;
}

/// Through a lens that blurs, a body is seen where it is, between the pixels too, and as a star would be.
TEST(Handover, PlaceAndFormAreThoseOfAPointBetweenThePixels) {
    constexpr double kRadius_m = 5, kView_px = 1300;
    for (const bool mesh : {false, true}) {
        Scene scene;
        scene.materials.push_back(lambert(0));
        scene.materials[0].emission = {1, 1, 1};
        if (mesh)
            add_mesh(scene, icosphere(4, kRadius_m));
        else
            add_sphere(scene, kRadius_m, {});
        auto render_scene = RenderScene::create(scene, 1);
        ASSERT_TRUE(render_scene);
        std::mt19937_64 random(6);
        std::uniform_real_distribution<double> place(-3, 3);  // over corners of tiles and of their blocks
        for (const auto& [spread, form] : kSpreads)
            for (const bool fisheye : {false, true}) {
                Camera c = camera(81, 81, kView_px);
                if (fisheye) c.model = kannala_brandt(pinhole_of(c), {0.1, -0.02, 0, 0});
                c.optics.point_spread = spread;
                CameraRenderer renderer(*render_scene, c);
                const PointResponse response(spread, 0);
                RadianceImage image(c.width, c.height);
                for (double diameter_px = 0.05; diameter_px < 2; diameter_px *= 1.6) {
                    const double distance_m = 2 * kRadius_m * kView_px / diameter_px;
                    const ImagePoint p{40 + place(random), 40 + place(random)};
                    BodyPoses at(1);
                    at.set(0, {{}, distance_m * c.model->direction(p)});
                    renderer.render(at, {}, {.spp = 16}, image);
                    const LightSpot seen = blob(image);
                    EXPECT_NEAR(seen.x, p.x, 0.01) << diameter_px << " px";
                    EXPECT_NEAR(seen.y, p.y, 0.01) << diameter_px << " px";
                    if (diameter_px > 0.2) continue;  // larger ones are wider than a star
                    EXPECT_LT(difference_from_star(image, response, {seen.light, p.x, p.y}), form)
                        << spread.sigma_px << " px, " << diameter_px << " px";
                }
            }
    }
}

}  // namespace
}  // namespace narpa
