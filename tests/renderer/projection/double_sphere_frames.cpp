// Frames through a double-sphere lens of more than 180 degrees.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "renderer/frame/culling/tile_culling.h"
#include "renderer/projection/double_sphere.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

Camera fisheye(int width, int height, double f) {
    Camera c = camera(width, height, f);
    c.model = make_projection({&kDoubleSphere, pinhole_of(c), {-0.2, 0.6}});
    return c;
}

/// Small glowing spheres, up to 105 degrees off the axis, are imaged where the model projects their centres.
TEST(DoubleSphere, RenderedSpheresStandWhereTheyProject) {
    constexpr double kRadius_m = 0.02;  // larger discs are drawn out towards the rim
    const Camera c = fisheye(400, 400, 80);
    for (const double theta_deg : {0.0, 25.0, 60.0, 95.0, 105.0})
        for (const double phi : {0.3, 2.1, 4.4}) {
            const double theta = theta_deg * kPi / 180;
            const Vec3 d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
            Scene scene;
            Material glowing = lambert(0);
            glowing.emission = {1, 1, 1};
            scene.materials.push_back(glowing);
            add_sphere(scene, kRadius_m, d);
            const RadianceImage image = rendered(scene, c, {}, {.spp = 64});
            double sum = 0, x_sum = 0, y_sum = 0;
            for (int y = 0; y < c.height; ++y)
                for (int x = 0; x < c.width; ++x) {
                    const double v = image.pixels[static_cast<std::size_t>(y * c.width + x)].y;
                    sum += v, x_sum += v * x, y_sum += v * y;
                }
            const auto expected = c.model->project(d);
            ASSERT_TRUE(expected);
            ASSERT_GT(sum, 1) << theta_deg;
            EXPECT_NEAR(x_sum / sum, expected->x, 0.05) << theta_deg;
            EXPECT_NEAR(y_sum / sum, expected->y, 0.05) << theta_deg;
            // The area of the disc: its solid angle by the model's magnification, which varies by a few per cent.
            const double solid_angle = 2 * kPi * (1 - std::cos(std::asin(kRadius_m)));
            EXPECT_NEAR(sum / (solid_angle * c.model->pixels_per_sr(d)), 1, 0.05) << theta_deg;
        }
}

/// Each body that a ray meets is listed for the ray's tile, in a field of more than 180 degrees.
TEST(DoubleSphere, TileCullingMissesNoBody) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> unit(0, 1);
    Scene scene;
    scene.materials.push_back(lambert(1));
    for (int i = 0; i < 4; ++i) add_mesh(scene, bumpy(2, 1 + i, 0.4));
    for (int i = 0; i < 4; ++i) add_sphere(scene, std::pow(10.0, i - 2), {});
    scene.bodies.back().shape = exact_ellipsoid({0.1, 3, 20});
    auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    const Camera c = fisheye(150, 150, 45);
    TileCulling culling(*tracer, c);
    BodyPoses at(scene.bodies.size());
    std::size_t met = 0, missed = 0, behind = 0;
    for (int pose = 0; pose < 40; ++pose) {
        const Rigid3 T{random_attitude(random), 1e4 * random_direction(random)};
        for (std::size_t b = 0; b < scene.bodies.size(); ++b)
            at.set(b, {random_attitude(random), T.t + tracer->bounding_radius_m(b) * std::exp(4 * unit(random)) *
                                                          unit(random) * random_direction(random)});
        culling.update(at, T, nullptr);
        for (int i = 0; i < 1500; ++i) {
            const double x = -0.5 + c.width * unit(random), y = -0.5 + c.height * unit(random);
            if (!c.model->sees({x, y})) continue;
            const Hit hit = tracer->intersect(at, camera_ray(c, T, x, y), kInfinity);
            if (hit.body < 0) continue;
            const auto bodies =
                culling.bodies(static_cast<int>((x + 0.5) / kTileSize), static_cast<int>((y + 0.5) / kTileSize));
            ++met;
            behind += c.model->direction({x, y}).z < 0;
            missed += !std::binary_search(bodies.begin(), bodies.end(), static_cast<std::uint32_t>(hit.body));
        }
    }
    EXPECT_EQ(missed, 0u) << "of " << met;
    EXPECT_GT(met, 10'000u);
    EXPECT_GT(behind, 100u);
}

}  // namespace
}  // namespace narpa
