// The Medium joint: a homogeneous medium that is not in the product, rendered against Beer and Lambert's law.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace narpa::test;

/// Absorbs and emits alike everywhere: transmittance exp(-k s), in-scattering e / k (1 - exp(-k s)).
class Homogeneous final : public Medium {
public:
    static constexpr Vec3 kAbsorption{0.1, 0.2, 0.4};  ///< 1/m
    explicit Homogeneous(double emission) : emission_(emission) {}

    [[nodiscard]] MediumSegment along(const BodyPoses& at, const Ray& ray, double range_m,
                                      double) const noexcept override {
        const Rgb through = transmittance(at, ray, range_m);
        const Vec3 source{emission_ / kAbsorption.x, emission_ / kAbsorption.y, emission_ / kAbsorption.z};
        return {through, vec_cast<float>(source) * (Rgb{1, 1, 1} - through)};
    }
    [[nodiscard]] Rgb transmittance(const BodyPoses&, const Ray&, double range_m) const noexcept override {
        return {passes(kAbsorption.x, range_m), passes(kAbsorption.y, range_m), passes(kAbsorption.z, range_m)};
    }
    static float passes(double absorption, double range_m) {
        return static_cast<float>(std::exp(-absorption * range_m));
    }

private:
    double emission_;
};

Estimate estimate(const Scene& s, double emission, const Ray& ray, const PathSettings& settings,
                  std::uint32_t samples = 1) {
    const auto render_scene = RenderScene::create(s, 1, nullptr, std::make_unique<Homogeneous>(emission));
    EXPECT_TRUE(render_scene);
    return light_along(*render_scene, placed(s), ray, settings, samples);
}

Scene white_plate() {
    Scene s;
    s.materials.push_back(lambert(0.8f));
    add_mesh(s, plate(4, 4));  // faces +z
    return s;
}

TEST(JointMedium, AttenuatesAnEmissiveSurfaceAndAddsItsOwnLight) {
    Scene s = white_plate();
    s.materials[0].emission = {3, 3, 3};
    const Ray ray = ray_to({0, 0, 5}, {});
    for (const bool direct : {false, true}) {
        const Vec3 seen = estimate(s, 0.7, ray, {.max_depth = 1, .direct = direct}, direct ? 1 : 4096).mean;
        const double tolerance = direct ? 1e-5 : 3e-3;  // paths end by Russian roulette
        // By paths the plate reflects what the medium emits above it, too: e / k from all sides.
        const auto expected = [&](double k) {
            const double reflected = direct ? 0 : 0.8 * 0.7 / k;
            return (3 + reflected) * std::exp(-5 * k) + 0.7 / k * (1 - std::exp(-5 * k));
        };
        EXPECT_NEAR(seen.x, expected(0.1), tolerance) << direct;
        EXPECT_NEAR(seen.y, expected(0.2), tolerance) << direct;
        EXPECT_NEAR(seen.z, expected(0.4), tolerance) << direct;
    }
}

TEST(JointMedium, EscapedRaysSeeItsWholeDepth) {
    Scene s = white_plate();
    s.ambient = {9, 9, 9};  // nothing of it arrives through an infinite depth
    const Vec3 seen = estimate(s, 0.7, {{0, 0, 5}, {0, 0, 1}}, {}).mean;
    EXPECT_NEAR(seen.x, 7, 1e-5);
    EXPECT_NEAR(seen.y, 3.5, 1e-5);
    EXPECT_NEAR(seen.z, 1.75, 1e-5);
}

TEST(JointMedium, ShadowRaysReturnItsTransmittance) {
    // A point light 2 m above the plate, seen from 5 m: attenuated over 2 m and 5 m.
    Scene s = white_plate();
    s.lights.push_back({.name = "lamp", .kind = Light::Kind::point, .emission = {4, 4, 4}});
    s.lights[0].T_mount_light.t = {0, 0, 2};
    for (const bool direct : {false, true}) {
        const Vec3 seen = estimate(s, 0, ray_to({0, 0, 5}, {}), {.max_depth = 1, .direct = direct}).mean;
        const double vacuum = 0.8 / std::numbers::pi * 4 / 4;
        EXPECT_NEAR(seen.x, vacuum * std::exp(-0.1 * 7), 1e-4) << direct;
        EXPECT_NEAR(seen.y, vacuum * std::exp(-0.2 * 7), 1e-4) << direct;
        EXPECT_NEAR(seen.z, vacuum * std::exp(-0.4 * 7), 1e-4) << direct;
    }
}

TEST(JointMedium, LightsWithExtentAreAttenuatedByEitherTechnique) {
    // A wide disc close above the plate: next-event estimation and BSDF sampling both find it.
    Scene s = white_plate();
    Light disc{.name = "disc", .kind = Light::Kind::disc, .emission = {1, 1, 1}, .radius_m = 1};
    disc.T_mount_light = {Quat{0, 1, 0, 0}, {0, 0, 1}};  // shines downwards
    s.lights.push_back(disc);
    const Estimate e = estimate(s, 0, ray_to({0, 1.9, 2}, {}), {.max_depth = 1}, 16384);
    // The integral over the disc of cos^2 / r^2 exp(-k r), with the distance to the eye; r^2 = 1 + q^2.
    const auto expected = [](double k) {
        double sum = 0;
        constexpr int kSteps = 100000;
        for (int i = 0; i < kSteps; ++i) {
            const double q = (i + 0.5) / kSteps, r2 = 1 + q * q;
            sum += 2 * std::numbers::pi * q / (r2 * r2) * std::exp(-k * std::sqrt(r2)) / kSteps;
        }
        return 0.8 / std::numbers::pi * sum * std::exp(-k * std::hypot(1.9, 2));
    };
    EXPECT_NEAR(e.mean.x, expected(0.1), 3e-3 * expected(0.1));
    EXPECT_NEAR(e.mean.z, expected(0.4), 3e-3 * expected(0.4));
}

}  // namespace
}  // namespace narpa
