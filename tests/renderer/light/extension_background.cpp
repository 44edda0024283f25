// The Background joint: a gradient that is not in the product, rendered against its closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "renderer/camera/scene_camera.h"
#include "renderer/frame/camera_image.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace narpa::test;

/// Radiance a + b cos(angle from +z), in each band another a and b.
class Gradient : public Background {
public:
    [[nodiscard]] Rgb radiance(const Vec3& d) const noexcept override {
        const auto z = static_cast<float>(d.z);
        return {1 + z, 2 + 0.5f * z, 3 - 2 * z};
    }
};
/// The same, with directions sampled uniformly over the sphere.
class SampledGradient final : public Gradient {
public:
    [[nodiscard]] bool is_sampled() const noexcept override { return true; }
    [[nodiscard]] BackgroundSample sample(double u, double v) const noexcept override {
        const double z = 1 - 2 * u, r = std::sqrt(1 - z * z), phi = 2 * std::numbers::pi * v;
        const Vec3 d{r * std::cos(phi), r * std::sin(phi), z};
        return {d, radiance(d), pdf(d)};
    }
    [[nodiscard]] double pdf(const Vec3&) const noexcept override { return 0.25 * std::numbers::inv_pi; }
};

RadianceImage render(const Scene& s, const Camera& c, const Rigid3& T, RenderSettings::Method method) {
    const auto render_scene = RenderScene::create(s, 1, std::make_unique<Gradient>());
    EXPECT_TRUE(render_scene);
    RadianceImage image(c.width, c.height);
    FrameSettings settings;
    settings.method = method;
    render_radiance(*render_scene, placed(s), c, T, settings, image);
    return image;
}

TEST(JointBackground, AnEmptySceneShowsItInEachPixel) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_sphere(s, 1, {0, 0, -100});  // behind the camera
    const Camera c = camera(40, 24, 20);
    const Rigid3 T = looking({}, {1, 0.3, 0.5});
    for (const auto method : {RenderSettings::Method::direct, RenderSettings::Method::path}) {
        const RadianceImage image = render(s, c, T, method);
        for (int y = 0; y < c.height; ++y)
            for (int x = 0; x < c.width; ++x) {
                const Rgb expected = Gradient().radiance(camera_ray(c, T, x, y).direction);
                const Rgb& seen = image.pixels[static_cast<std::size_t>(y * c.width + x)];
                ASSERT_NEAR(seen.x, expected.x, 1e-5f);
                ASSERT_NEAR(seen.y, expected.y, 1e-5f);
                ASSERT_NEAR(seen.z, expected.z, 1e-5f);
            }
    }
}

TEST(JointBackground, LightsALambertPlaneByItsIrradiance) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, plate(4, 4));  // faces +z
    const Ray ray = ray_to({0.2, 0.3, 3}, {});
    for (const bool sampled : {false, true}) {
        std::unique_ptr<const Background> background = std::make_unique<Gradient>();
        if (sampled) background = std::make_unique<SampledGradient>();
        const auto render_scene = RenderScene::create(s, 1, std::move(background));
        ASSERT_TRUE(render_scene);
        const Estimate e = light_along(*render_scene, placed(s), ray, PathSettings{.max_depth = 2}, 4096);
        // Irradiance: the integral of (a + b cos) cos over the hemisphere, pi a + 2/3 pi b. Radiance: albedo / pi
        // of it.
        EXPECT_NEAR(e.mean.x, 0.5 * (1 + 2.0 / 3), 2e-3) << sampled;
        EXPECT_NEAR(e.mean.y, 0.5 * (2 + 1.0 / 3), 2e-3) << sampled;
        EXPECT_NEAR(e.mean.z, 0.5 * (3 - 4.0 / 3), 4e-3) << sampled;
    }
}

}  // namespace
}  // namespace narpa
