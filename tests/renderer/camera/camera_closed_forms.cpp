// Light through the whole camera where it has a closed form, by both methods.
#include <gtest/gtest.h>

#include "base/constants.h"
#include "renderer/frame/camera_image.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using Method = RenderSettings::Method;
constexpr double kSolar = 1361;

FrameSettings by(Method method, int spp, int max_depth = 1) {
    FrameSettings settings;
    settings.spp = spp;
    settings.method = method;
    settings.max_depth = max_depth;
    return settings;
}

constexpr double kAlbedo = 0.5, kRadius = 5, kDistance = 1e6;

/// A Lambert sphere of this many pixels across, the Sun at this phase angle, seen from far away.
double sphere_at(double phase, Method method, int pixels, int spp) {
    Scene s;
    s.materials.push_back(lambert(static_cast<float>(kAlbedo)));
    add_sphere(s, kRadius, {});
    add_sun(s, {std::cos(phase), std::sin(phase), 0});
    const Camera c = camera(pixels + 8, pixels + 8, pixels * kDistance / (2 * kRadius));
    return irradiance(rendered(s, c, looking({kDistance, 0, 0}, {}), by(method, spp)), c);
}
/// Lambert's law integrated over the lit and visible lune, for a point Sun.
double lambert_phase(double phase) {
    return (std::sin(phase) + (kPi - phase) * std::cos(phase)) / kPi;
}
const double kFull = kSolar * 2 * kAlbedo / 3 * std::pow(kRadius / kDistance, 2);

TEST(ClosedForm, LambertSphereByPathsIsTheClosedFormToOnePerMille) {
    for (const double phase : {0.0, 0.7, 1.5707963, 2.2})
        for (const Method method : {Method::direct, Method::path})
            EXPECT_NEAR(sphere_at(phase, method, 120, 16) / (kFull * lambert_phase(phase)), 1, 1e-3)
                << "phase " << phase << (method == Method::path ? " path" : " direct");
}

TEST(ClosedForm, PhaseIntegralOfALambertSphereIsThreeHalvesToOnePerMille) {
    // q = 2 integral of phi(alpha) sin(alpha), by Gauss and Legendre's rule with 8 points: exact to 1e-7 for phi.
    constexpr std::array<double, 4> node{0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                         0.9602898564975363};
    constexpr std::array<double, 4> weight{0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                           0.1012285362903763};
    double exact = 0, seen = 0;
    for (std::size_t k = 0; k < 4; ++k)
        for (const double side : {-1.0, 1.0}) {
            const double phase = kPi / 2 * (1 + side * node[k]), w = 2 * kPi / 2 * weight[k] * std::sin(phase);
            exact += w * lambert_phase(phase);
            seen += w * sphere_at(phase, Method::direct, 160, 16) / kFull;
        }
    EXPECT_NEAR(exact, 1.5, 1e-6);
    EXPECT_NEAR(seen / 1.5, 1, 1e-3);
}

TEST(ClosedForm, LambertPlaneUnderTheSunByPathsFollowsTheCosine) {
    for (const double zenith : {0.0, 0.6, 1.2}) {
        Scene s;
        s.materials.push_back(lambert(0.25f));
        add_mesh(s, plate(10, 10));
        add_sun(s, {std::sin(zenith), 0, std::cos(zenith)});
        const Camera c = camera(8, 8, 20);
        const Rigid3 T = looking({0.1, 0.2, 5}, {0, 0, 0}, {0, 1, 0});
        const double expected = 0.25 * kSolar * std::cos(zenith) / kPi;
        for (const Rgb& p : rendered(s, c, T, by(Method::path, 1, 4)).pixels)
            // One point of the Sun: its height differs from the centre's by up to half of its diameter.
            EXPECT_NEAR(static_cast<double>(p.x) / expected, 1, 0.0047 * std::tan(zenith) + 2e-5) << zenith;
        for (const Rgb& p : rendered(s, c, T, by(Method::path, 64, 4)).pixels)
            EXPECT_NEAR(static_cast<double>(p.x) / expected, 1, 2e-4 * std::tan(zenith) + 2e-5) << zenith;
    }
}

TEST(ClosedForm, LambertPlaneUnderAVeryLargeSunFacingItGetsItsIrradiance) {
    Scene s;
    s.materials.push_back(lambert(0.25f));
    add_mesh(s, plate(10, 10));
    add_sun(s, {0, 0, 1});
    s.sun->angular_diameter_rad = 2 * kPi / 3;
    const Camera c = camera(8, 8, 20);
    const Rigid3 T = looking({0.1, 0.2, 5}, {0, 0, 0}, {0, 1, 0});
    for (const Method method : {Method::direct, Method::path})
        for (const Rgb& p : rendered(s, c, T, by(method, 64, 4)).pixels)
            EXPECT_NEAR(static_cast<double>(p.x) / (0.25 * kSolar / kPi), 1, 1e-5);
}

TEST(ClosedForm, SkySunAndLampsThatTheCameraLooksAt) {
    // Nothing but the sky: the ambient by paths, black by direct light.
    Scene s;
    s.materials.push_back(lambert(0.5f));
    s.ambient = {2, 3, 5};
    const Camera c = camera(4, 4, 100);
    for (const Rgb& p : rendered(s, c, {}, by(Method::path, 2)).pixels) EXPECT_EQ(p, (Rgb{2, 3, 5}));
    for (const Rgb& p : rendered(s, c, {}, by(Method::direct, 2)).pixels) EXPECT_EQ(p, Rgb{});
    // The Sun's disc gives its irradiance to a camera that faces it.
    s.ambient = {};
    add_sun(s, {0, 0, 1});
    const Camera solar = camera(60, 60, 50 / (0.533 * kPi / 180));
    EXPECT_NEAR(irradiance(rendered(s, solar, {}, by(Method::path, 64)), solar) / kSolar, 1, 1e-3);
    // A lamp is seen by both methods, with its radiance.
    s.sun.reset();
    Light lamp;
    lamp.kind = Light::Kind::rectangle;
    lamp.T_mount_light = {{0, 1, 0, 0}, {0, 0, 3}};  // shines back at the camera
    lamp.emission = {7, 8, 9};
    s.lights.push_back(lamp);
    for (const Method method : {Method::direct, Method::path})
        for (const Rgb& p : rendered(s, c, {}, by(method, 4)).pixels) EXPECT_EQ(p, (Rgb{7, 8, 9}));
}

TEST(ClosedForm, DirectLightOfALampIsThatOfPathsWithOneSurface) {
    // A lamp 1 m square, 2 m above the floor; and Sun-only direct lighting.
    Scene s;
    s.materials.push_back(lambert(0.6f));
    add_mesh(s, plate(10, 10));
    add_mesh(s, box(0.3, 0.3, 0.3), {{}, {0.4, 0.2, 0.8}});
    Light lamp;
    lamp.kind = Light::Kind::rectangle;
    lamp.T_mount_light = {{0, 1, 0, 0}, {0, 0, 2}};
    lamp.emission = {50, 50, 50};
    s.lights.push_back(lamp);
    const Camera c = camera(24, 24, 24);
    const Rigid3 T = looking({2, -2, 1.5}, {0, 0, 0.1});
    const auto direct = rendered(s, c, T, by(Method::direct, 64)), path = rendered(s, c, T, by(Method::path, 64));
    double difference = 0, sum = 0;
    for (std::size_t i = 0; i < direct.pixels.size(); ++i) {
        difference += static_cast<double>(direct.pixels[i].y - path.pixels[i].y);
        sum += static_cast<double>(path.pixels[i].y);
    }
    EXPECT_GT(sum, 100);
    EXPECT_NEAR(difference / sum, 0, 1e-3);
    s.lights.clear();
    add_sun(s, {0.3, 0.2, 1});
    const auto quick = rendered(s, c, T, by(Method::direct, 64)), sunlit = rendered(s, c, T, by(Method::path, 64));
    difference = sum = 0;
    for (std::size_t i = 0; i < quick.pixels.size(); ++i) {
        difference += static_cast<double>(quick.pixels[i].y - sunlit.pixels[i].y);
        sum += static_cast<double>(sunlit.pixels[i].y);
    }
    EXPECT_NEAR(difference / sum, 0, 2e-3);
}

TEST(ClosedForm, MirrorsAndGlassAreBlackInDirectLight) {
    for (const auto kind : {&kinds::mirror, &kinds::dielectric}) {
        Scene s;
        Material m = lambert(0);
        m.kind = kind;
        m.specular = {0.9f, 0.9f, 0.9f};
        s.materials.push_back(m);
        add_sphere(s, 1, {});
        add_sun(s, {1, 0.3, 0.2});
        for (const Rgb& p : rendered(s, camera(16, 16, 40), looking({4, 0, 0}, {}), by(Method::direct, 4)).pixels)
            EXPECT_EQ(p, Rgb{});
    }
}

}  // namespace
}  // namespace narpa
