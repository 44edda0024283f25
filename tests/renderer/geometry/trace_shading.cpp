// Light on shapes with closed forms.
#include <gtest/gtest.h>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/integrator/sampler.h"
#include "renderer/integrator/shading.h"
#include "renderer/lidar/lidar_shot.h"
#include "renderer/light/sun_disc.h"
#include "renderer/material/bsdf.h"
#include "renderer/material/texture/texture_lookup.h"
#include "tests/renderer/camera/camera_support.h"

namespace narpa {
namespace {

using namespace test;
constexpr double kSolar = 1361;

class LambertSphere : public testing::TestWithParam<double> {};

TEST_P(LambertSphere, IrradianceAtThisPhaseIsTheClosedFormToOnePerMille) {
    const double phase = GetParam(), albedo = 0.5, radius = 5, distance = 1e6;
    Scene s;
    s.materials.push_back(lambert(static_cast<float>(albedo)));
    add_sphere(s, radius, {});
    add_sun(s, {std::cos(phase), std::sin(phase), 0});
    const Camera c = camera(200, 200, 180 * distance / (2 * radius));  // 180 px across
    const double seen = irradiance(rendered(s, c, looking({distance, 0, 0}, {}), {.spp = 16}), c);
    // Lambert's law integrated over the lit and visible lune (far away).
    const double expected = kSolar * 2 * albedo / (3 * kPi) * std::pow(radius / distance, 2) *
                            (std::sin(phase) + (kPi - phase) * std::cos(phase));
    EXPECT_NEAR(seen / expected, 1, 1e-3);
}
INSTANTIATE_TEST_SUITE_P(Phases, LambertSphere, testing::Values(0.0, 0.5, 1.0, 1.5707963, 2.2));

TEST(Lambert, PlaneUnderTheSunFollowsTheCosine) {
    for (const double zenith : {0.0, 0.4, 1.0, 1.5}) {
        Scene s;
        s.materials.push_back(lambert(0.25f));
        add_mesh(s, plate(10, 10));
        add_sun(s, {std::sin(zenith), 0, std::cos(zenith)});
        const Camera c = camera(8, 8, 20);
        for (const Rgb& p : rendered(s, c, looking({0.1, 0.2, 5}, {0, 0, 0}, {0, 1, 0})).pixels)
            EXPECT_NEAR(static_cast<double>(p.x), 0.25 * kSolar * std::cos(zenith) / kPi, 1e-5 * kSolar);
    }
}

TEST(Lambert, FurnaceGivesBackExactlyTheAmbientRadiance) {
    Scene s;
    s.materials.push_back(lambert(1));
    s.ambient = {2, 3, 5};
    add_sphere(s, 1, {});
    const Camera c = camera(32, 32, 60);
    for (const Rgb& p : rendered(s, c, looking({3, 0, 0}, {})).pixels)
        EXPECT_TRUE((p == Rgb{2, 3, 5}) || (p == Rgb{})) << p.x;
    // And a camera inside sees it everywhere.
    for (const Rgb& p : rendered(s, c, looking({0.2, 0, 0}, {1, 1, 0})).pixels) EXPECT_EQ(p, (Rgb{2, 3, 5}));
}

TEST(Emission, IsSeenInTheDarkFromBothSides) {
    Scene s;
    Material m = lambert(0.5f);
    m.emission = {7, 8, 9};
    s.materials.push_back(m);
    add_mesh(s, plate(10, 10));
    const Camera c = camera(4, 4, 10);
    for (const double z : {5.0, -5.0})
        for (const Rgb& p : rendered(s, c, looking({0.1, 0.2, z}, {0, 0, 0}, {0, 1, 0})).pixels)
            EXPECT_EQ(p, (Rgb{7, 8, 9}));
}

TEST(Sun, SetSunLightsNothingAndABodyCastsAShadow) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, plate(20, 20));
    add_sphere(s, 1, {0, 0, 3});
    add_sun(s, {0, 0, 1});
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const auto lit = [&](double x) {
        const Ray ray{{x, 5, 5}, normalized(Vec3{0, -5, -5})};
        const Hit hit = render_scene->tracer().intersect(at, ray, kInfinity);
        EXPECT_EQ(hit.body, 0);
        return !render_scene->tracer().occluded(at, hit, {0, 0, 1}, kInfinity);
    };
    EXPECT_FALSE(lit(0));
    EXPECT_FALSE(lit(0.999));
    EXPECT_TRUE(lit(1.001));
    EXPECT_TRUE(lit(-2));

    Scene night = s;
    night.sun->direction = {0, 0, -1};
    const Camera c = camera(8, 8, 20);
    for (const Rgb& p : rendered(night, c, looking({4, 0, 5}, {4.1, 0, 0}, {0, 1, 0})).pixels) EXPECT_EQ(p, Rgb{});
}

TEST(Sun, PenumbraOfAStraightEdgeIsTheVisiblePartOfTheDisc) {
    // A half plane 10 m above a plate: at signed distance d from the edge's shadow the Sun's disc is cut at
    // d / (10 tan(half angle)).
    Scene s;
    s.materials.push_back(lambert(1));
    add_mesh(s, plate(2, 2));
    add_mesh(s, plate(100, 100), {{}, {-50, 0, 10}});
    add_sun(s, {0, 0, 1});
    s.sun->angular_diameter_rad = 0.02;
    constexpr double kFocal_px = 41 / 0.24 * 1.0;  // 0.24 m across at 1 m
    const Camera c = camera(41, 1, kFocal_px);
    const RadianceImage image = rendered(s, c, looking({0, 0, 1}, {0, 0, 0}, {0, 1, 0}), {.spp = 1024});
    for (int x = 0; x < 41; ++x) {
        const double d = (x - 20) / kFocal_px, cut = std::clamp(d / (10 * std::tan(0.01)), -1.0, 1.0);
        const double visible = 1 - (std::acos(cut) - cut * std::sqrt(1 - cut * cut)) / kPi;
        EXPECT_NEAR(static_cast<double>(image.pixels[static_cast<std::size_t>(x)].x) / (kSolar / kPi), visible,
                    0.01)
            << x;
    }
}

TEST(SunDisc, SamplesFillTheDiscEvenly) {
    Sun sun;
    sun.direction = normalized(Vec3{-0.3, 0.9, -0.2});
    const SunDisc disc(sun);
    const double half = 0.5 * sun.angular_diameter_rad;
    Vec3 sum{};
    double within_half_area = 0;
    constexpr int n = 4096;
    const PixelSampler sampler(1, 2, 3);
    for (std::uint32_t i = 0; i < n; ++i) {
        const SamplePoint p = sampler.point(i);
        const Vec3 d = disc.sample(p[2], p[3]);
        EXPECT_NEAR(norm(d), 1, 1e-12);
        const double angle = norm(cross(d, disc.centre()));
        EXPECT_LE(angle, std::sin(half) * (1 + 1e-9));
        within_half_area += angle < std::sin(half) / std::sqrt(2.0);
        sum += d;
    }
    EXPECT_NEAR(within_half_area / n, 0.5, 1e-3);
    EXPECT_LE(norm(cross(sum / double{n}, disc.centre())), 1e-3 * half);
}

TEST(Sampler, PowersOfTwoAreStratified) {
    const PixelSampler sampler(42, 7, 1234);
    for (const unsigned log_n : {4u, 8u, 10u}) {
        const std::uint32_t n = 1u << log_n;
        for (unsigned dim = 0; dim < 4; ++dim) {
            std::vector<int> bin(n);
            for (std::uint32_t i = 0; i < n; ++i) ++bin[static_cast<std::size_t>(sampler.point(i)[dim] * n)];
            EXPECT_TRUE(std::all_of(bin.begin(), bin.end(), [](int k) { return k == 1; })) << dim;
        }
        const std::uint32_t side = 1u << (log_n / 2);  // and the pairs that belong together, in two dimensions
        for (const unsigned dim : {0u, 2u}) {
            std::vector<int> cell(n);
            for (std::uint32_t i = 0; i < n; ++i) {
                const SamplePoint p = sampler.point(i);
                ++cell[static_cast<std::size_t>(p[dim] * side) * side +
                       static_cast<std::size_t>(p[dim + 1] * side)];
            }
            const int most = *std::max_element(cell.begin(), cell.end());
            EXPECT_LE(most, dim == 0 ? 1 : 2) << dim << " of " << n;
        }
    }
}

TEST(Sampler, ConvergesFasterThanChance) {
    // Area of a quarter disc: the rms error over many pixels at 256 points; chance gives 0.026.
    double squares = 0;
    constexpr int kPixels = 200;
    for (std::uint32_t pixel = 0; pixel < kPixels; ++pixel) {
        const PixelSampler sampler(1, 0, pixel);
        int inside = 0;
        for (std::uint32_t i = 0; i < 256; ++i) {
            const SamplePoint p = sampler.point(i);
            inside += p[0] * p[0] + p[1] * p[1] < 1;
        }
        squares += std::pow(inside / 256.0 - kPi / 4, 2);
    }
    EXPECT_LT(std::sqrt(squares / kPixels), 0.009);
}

TEST(Brdf, PhongIsReciprocalAndDarkBelowTheHorizon) {
    Surface s;
    s.diffuse = {0.3f, 0.2f, 0.1f};
    s.specular = {0.5f, 0.5f, 0.5f};
    s.exponent = 40;
    std::mt19937_64 random(8);
    const Vec3 n{0, 0, 1};
    for (int i = 0; i < 1000; ++i) {
        Vec3 a = random_direction(random), b = random_direction(random);
        if (a.z < 0 || b.z < 0) {
            EXPECT_EQ(bsdf(s, n, a, b), Rgb{});
            continue;
        }
        const Rgb f = bsdf(s, n, a, b), g = bsdf(s, n, b, a);
        EXPECT_NEAR(f.x, g.x, 1e-5f * f.x);
        EXPECT_NEAR(f.z, g.z, 1e-5f * f.z);
    }
    // The mirror direction sees the peak: ks (n + 2) / (2 pi) over the diffuse kd / pi.
    const Vec3 l = normalized(Vec3{1, 0, 1}), v = normalized(Vec3{-1, 0, 1});
    EXPECT_NEAR(bsdf(s, n, l, v).y, 0.2 / kPi + 0.5 * 42 / (2 * kPi), 1e-4);
}

/// A lit point that comes out dark, seen by the sphere that the mesh stands for.
TEST(ShadowTerminator, SmoothSpheresHaveNoFalseShadows) {
    for (const int level : {3, 4, 6}) {
        Scene s;
        s.materials.push_back(lambert(0.5f));
        add_mesh(s, icosphere(level, 1, true));
        const double phase = 135 * kPi / 180;
        add_sun(s, {std::cos(phase), std::sin(phase), 0});
        const auto render_scene = RenderScene::create(s, 1);
        ASSERT_TRUE(render_scene);
        const BodyPoses at = placed(s);
        const Camera c = camera(300, 300, 2900);
        const Rigid3 T = looking({20, 0, 0}, {});
        int lit = 0, dark = 0;
        double flux = 0, unshadowed = 0;
        for (int y = 0; y < c.height; ++y)
            for (int x = 0; x < c.width; ++x) {
                const Hit hit = render_scene->tracer().intersect(at, camera_ray(c, T, x, y), kInfinity);
                if (hit.body < 0) continue;
                const double cosine = dot(hit.shading_normal, s.sun->direction);
                if (cosine <= 0) continue;
                ++lit;
                const bool blocked = render_scene->tracer().occluded(at, hit, s.sun->direction, kInfinity);
                dark += blocked;
                unshadowed += cosine;
                flux += blocked ? 0 : cosine;
            }
        EXPECT_GT(lit, 5000);
        EXPECT_LE(dark, 1e-3 * lit) << level;
        EXPECT_NEAR(flux / unshadowed, 1, 1e-4) << level;
    }
}

TEST(ShadingNormal, StaysOnTheSideOfTheFaceWhateverTheFileSays) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    Mesh m = icosphere(2, 1, true);
    for (Vec3f& n : m.normals) n = -n;  // a file with its normals inside out
    add_mesh(s, m);
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    std::mt19937_64 random(9);
    for (int i = 0; i < 2000; ++i) {
        const Vec3 eye = 4.0 * random_direction(random);
        const Ray ray{eye, normalized(0.9 * random_direction(random) - eye)};
        const Hit hit = render_scene->tracer().intersect(placed(s), ray, kInfinity);
        if (hit.body < 0) continue;
        EXPECT_LT(dot(hit.geometric_normal, ray.direction), 0);
        EXPECT_GT(dot(hit.geometric_normal, hit.shading_normal), 0);
        EXPECT_NEAR(norm(hit.shading_normal), 1, 1e-6);
    }
}

TEST(Texture, IsBilinearRepeatsAndHasVUp) {
    // Two by two: red, green above; blue, white below.
    const Texture t{"t", 2, 2, {65535, 0, 0, 0, 65535, 0, 0, 0, 65535, 65535, 65535, 65535}};
    const auto near = [](const Rgb& a, const Rgb& b) {
        EXPECT_NEAR(a.x, b.x, 1e-5f);
        EXPECT_NEAR(a.y, b.y, 1e-5f);
        EXPECT_NEAR(a.z, b.z, 1e-5f);
    };
    near(texture_lookup(t, 0.25f, 0.75f), {1, 0, 0});
    near(texture_lookup(t, 0.75f, 0.75f), {0, 1, 0});
    near(texture_lookup(t, 0.25f, 0.25f), {0, 0, 1});
    near(texture_lookup(t, 0.75f, 0.25f), {1, 1, 1});
    near(texture_lookup(t, 0.5f, 0.75f), {0.5f, 0.5f, 0});
    near(texture_lookup(t, 0.5f, 0.5f), {0.5f, 0.5f, 0.5f});
    near(texture_lookup(t, 0.0f, 0.75f), {0.5f, 0.5f, 0});  // across the seam
    near(texture_lookup(t, -1.75f, 3.75f), {1, 0, 0});
}

TEST(Texture, OnAPlateAndOnASphere) {
    Scene s;
    Material m = lambert(1);
    m.texture = 0;
    s.materials.push_back(m);
    s.ambient = {1, 1, 1};
    // Red left, green right, on the upper half; blue on the lower half.
    s.textures.push_back({"t", 2, 2, {65535, 0, 0, 0, 65535, 0, 0, 0, 65535, 0, 0, 65535}});
    add_mesh(s, plate(2, 2));
    const Camera c = camera(101, 101, 250);
    const RadianceImage image = rendered(s, c, looking({0, 0, 5}, {0, 0, 0}, {0, 1, 0}));
    const auto at = [&](int x, int y) { return image.pixels[static_cast<std::size_t>(y * 101 + x)]; };
    EXPECT_GT(at(25, 25).x, 0.9f);
    EXPECT_GT(at(75, 25).y, 0.9f);
    EXPECT_GT(at(25, 75).z, 0.9f);

    Scene globe = s;
    globe.bodies.clear();
    globe.meshes.clear();
    add_sphere(globe, 1, {});
    // Longitude 90 deg east is u = 0.25 (red), 90 deg west u = 0.75 (green); south is blue.
    const auto colour = [&](const Vec3& from) {
        return rendered(globe, camera(1, 1, 1000), looking(from, {0, 0, 0}, {0.1, 0, 1})).pixels[0];
    };
    EXPECT_GT(colour({0, 4, 4}).x, 0.9f);
    EXPECT_GT(colour({0, -4, 4}).y, 0.9f);
    EXPECT_GT(colour({0, 4, -4}).z, 0.9f);
}

TEST(Lidar, PlateReturnsItsRangeBodyAndReflectance) {
    Scene s;
    s.materials.push_back(lambert(0.6f));
    add_sphere(s, 1, {0, 100, 0});
    add_mesh(s, plate(10, 10));
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const double tilt = 0.7;
    const Ray beam{20.0 * Vec3{std::sin(tilt), 0, std::cos(tilt)}, {-std::sin(tilt), 0, -std::cos(tilt)}};
    const LidarReturn hit = shoot(render_scene->tracer(), at, beam, {.range_max_m = 100});
    EXPECT_NEAR(hit.range_m, 20, 1e-9);
    EXPECT_EQ(hit.body, 1);
    EXPECT_NEAR(hit.reflectivity, 0.6 * std::cos(tilt), 1e-6);
    EXPECT_EQ(shoot(render_scene->tracer(), at, beam, {.range_max_m = 19.99}).range_m, 0);
    EXPECT_EQ(shoot(render_scene->tracer(), at, {beam.origin, -beam.direction}, {.range_max_m = 100}).body, -1);
}

}  // namespace
}  // namespace narpa
