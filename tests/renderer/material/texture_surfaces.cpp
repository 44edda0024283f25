// Textures seen through camera rays: plates and globes, near and far.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/integrator/shading.h"
#include "renderer/material/texture/texture_lookup.h"
#include "tests/renderer/material/texture_support.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

Scene with_texture(Texture t) {
    Scene s;
    Material m = lambert(1);
    m.texture = 0;
    s.materials.push_back(m);
    s.textures.push_back(std::move(t));
    return s;
}

/// A scene that can be looked at pixel by pixel.
class Look {
public:
    explicit Look(Scene scene)
        : scene_(std::make_unique<Scene>(std::move(scene))),
          tracer_(*Tracer::create(*scene_, 1)),
          at_(placed(*scene_)) {}

    [[nodiscard]] const Scene& scene() const { return *scene_; }
    /// The texture's value; negative where nothing is hit.
    [[nodiscard]] double value(const Camera& c, const Rigid3& T, double x, double y, bool filter = true) const {
        Hit hit;
        return value(c, T, x, y, filter, hit);
    }
    double value(const Camera& c, const Rigid3& T, double x, double y, bool filter, Hit& hit) const {
        const Ray ray = camera_ray(c, T, x, y);
        hit = tracer_.intersect(at_, ray, kInfinity);
        if (hit.body < 0) return -1;
        const double width_m = filter ? hit.range_m / pinhole_of(c).fx : 0;
        return static_cast<double>(surface_at(tracer_, at_, hit, ray.direction, width_m).diffuse.x);
    }

private:
    std::unique_ptr<Scene> scene_;
    Tracer tracer_;
    BodyPoses at_;
};

struct Spread {
    double mean = 0, deviation = 0;
};

template <class Value>  // i -> value
Spread spread(int n, Value value) {
    double sum = 0, squares = 0;
    for (int i = 0; i < n; ++i) {
        const double v = value(i);
        sum += v, squares += v * v;
    }
    const double mean = sum / n;
    return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean))};
}

TEST(TexturedPlate, FarCheckerboardIsItsMeanWhateverTheSubPixelShift) {
    // 7 does not divide 1024: no level of the texture is even.
    const Texture board = make(1024, 1024, [](int x, int y) { return (x / 7 + y / 7) % 2; });
    Scene s = with_texture(board);
    Mesh m = plate(500, 500);  // a metre for each repetition
    for (auto& uv : m.uvs) uv = {500 * uv[0], 500 * uv[1]};
    add_mesh(s, m);
    const Look look(s);
    // At 10 m a metre is 27.5 px: 37.2 texels, 5.3 squares a pixel.
    const Camera c = camera(20, 20, 275);
    const auto pixels = [&](double distance_m, double tilt, bool filter) {
        const Rigid3 T =
            looking({0, -distance_m * std::sin(tilt), distance_m * std::cos(tilt)}, {0, 0, 0}, {1, 0, 0});
        return spread(20 * 20 * 16, [&](int i) {
            const double x = i % 20 + (i / 400 % 4) * 0.25, y = i / 20 % 20 + (i / 1600) * 0.25;
            return look.value(c, T, x, y, filter);
        });
    };
    for (const double distance_m : {10.0, 23.0, 3000.0}) {
        const Spread seen = pixels(distance_m, 0, true);
        EXPECT_LT(seen.deviation, 0.01) << distance_m;
        EXPECT_NEAR(seen.mean / mean_of(board), 1, 0.005) << distance_m;
    }
    const Spread slanted = pixels(10, 1.2, true);
    EXPECT_LT(slanted.deviation, 0.01);
    EXPECT_NEAR(slanted.mean / mean_of(board), 1, 0.005);
    EXPECT_GT(pixels(10, 0, false).deviation, 0.4) << "without filtering: every pixel black or white";
}

TEST(TexturedPlate, NearViewIsTheBilinearLookup) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> any;
    Scene s = with_texture(make(64, 64, [&](int, int) { return any(random); }));
    add_mesh(s, plate(1, 1));
    const Look look(s);
    const Camera c = camera(200, 200, 2000);  // 0.64 texels a pixel at 20 m
    const Rigid3 T = looking({0, 0, 20}, {0, 0, 0}, {0, 1, 0});
    for (int i = 0; i < 2000; ++i) {
        Hit hit;
        const double seen = look.value(c, T, 60 + 80 * any(random), 60 + 80 * any(random), true, hit);
        ASSERT_GE(hit.body, 0);
        EXPECT_EQ(seen, static_cast<double>(texture_lookup(look.scene().textures[0], hit.u, hit.v).x));
    }
}

TEST(TexturedPlate, SeenAtEightyDegreesItKeepsTheDetailAcross) {
    // Stripes 8 texels wide. A pixel is 2 texels across the ray and 11.5 along it.
    const auto contrast = [](bool along_the_ray, bool anisotropic) {
        Scene s = with_texture(make(512, 512, [&](int x, int y) { return (along_the_ray ? x : y) / 8 % 2; }));
        add_mesh(s, plate(1, 1));
        const Look look(s);
        const Camera c = camera(64, 64, 2560);
        const double tilt = 80 * kPi / 180;
        const Rigid3 T = looking(10.0 * Vec3{0, -std::sin(tilt), std::cos(tilt)}, {0, 0, 0}, {0, 0, 1});
        return spread(64 * 16,
                      [&](int i) {
                          Hit hit;
                          const double seen = look.value(c, T, i % 64, 24 + i / 64, true, hit);
                          if (anisotropic) return seen;
                          const auto half =
                              static_cast<float>(0.5 * (hit.range_m / pinhole_of(c).fx) / std::cos(tilt));
                          return static_cast<double>(
                              texture_lookup(look.scene().textures[0], hit.u, hit.v, {{half, 0}, {0, half}}).x);
                      })
            .deviation;
    };
    EXPECT_GT(contrast(true, true), 0.40) << "of 0.5";
    EXPECT_LT(contrast(true, false), 0.20) << "blurred both ways";
    EXPECT_LT(contrast(false, true), 0.15) << "stripes across the ray cannot be told apart";
}

/// Value of the map at longitude and latitude, given as a function of the direction.
template <class Value>
Texture globe_map(int width, int height, Value value) {
    return make(width, height, [&](int x, int y) {
        const double u = (x + 0.5) / width, theta = kPi * (y + 0.5) / height;
        return value(Vec3{std::sin(theta) * std::cos(2 * kPi * u), std::sin(theta) * std::sin(2 * kPi * u),
                          std::cos(theta)});
    });
}

double smooth_globe(const Vec3& n) {
    return 0.5 + 0.15 * n.x * n.y + 0.12 * n.x + 0.1 * n.y * n.z + 0.1 * n.z;
}

class SmoothGlobe : public testing::TestWithParam<double> {};

TEST_P(SmoothGlobe, HasNeitherASeamNorPoles) {
    // A function of the direction alone, seen towards the seam (+x), along it and towards the poles.
    const double pixel_rad = GetParam();  // of the globe's surface
    for (const bool ellipsoid : {false, true}) {
        Scene s = with_texture(globe_map(512, 256, smooth_globe));
        add_sphere(s, 1, {0, 0, 0});
        if (ellipsoid) s.bodies[0].shape = exact_ellipsoid({1, 1, 0.9});
        const Look look(s);
        const Camera c = camera(41, 41, 49 / pixel_rad);
        for (const Vec3& from :
             {Vec3{50, 0, 0}, Vec3{0, 0, 50}, Vec3{0, 0, -50}, Vec3{3, 0.1, 49.9}, Vec3{30, 0, -40}}) {
            const Rigid3 T = looking(from, {0, 0, 0}, {0.01, 1, 0.02});
            for (int y = 0; y < 41; ++y)
                for (int x = 0; x < 41; ++x) {
                    Hit hit;
                    const double seen = look.value(c, T, x, y, true, hit);
                    if (hit.body < 0) continue;
                    const double cosine = -dot(hit.geometric_normal, normalized(hit.position - from));
                    if (cosine < 0.3) continue;  // the pixel spans much of the globe
                    // A texel is 0.012 rad; the map changes by 0.3 per radian, and its curvature over the
                    // pixel, 1.2 d^2 / 8, is what the mean loses.
                    const double allowed = 0.0005 + 0.15 * std::pow(pixel_rad / cosine, 2);
                    EXPECT_NEAR(seen, smooth_globe(hit.geometric_normal), allowed)
                        << x << ", " << y << " from " << from.x << ", " << from.z;
                }
        }
    }
}
INSTANTIATE_TEST_SUITE_P(PixelWidths, SmoothGlobe, testing::Values(0.002, 0.01, 0.04));

TEST(TexturedGlobe, NoiseLooksTheSameOnTheSeamAndAwayFromIt) {
    // The same picture on the globe, its seam once in front and once behind.
    std::mt19937 random(6);
    std::uniform_real_distribution<double> any;
    std::vector<double> value(256 * 128);
    for (double& v : value) v = any(random);
    const auto at = [&](int x, int y) { return value[static_cast<std::size_t>(256 * y + x % 256)]; };
    Scene front = with_texture(make(256, 128, at));
    Scene behind = with_texture(make(256, 128, [&](int x, int y) { return at(x + 128, y); }));
    add_sphere(front, 1, {});
    add_sphere(behind, 1, {});
    behind.bodies[0].initial.T_world_body.q = {0, 0, 0, 1};  // half a turn about z
    const Look a(front), b(behind);
    for (const double distance_m : {4.0, 20.0, 80.0}) {
        const Camera c = camera(64, 64, 600);
        const Rigid3 T = looking({distance_m, 0.01, 0.3 * distance_m}, {0, 0, 0});
        double largest = 0;
        for (int y = 0; y < 64; ++y)
            for (int x = 0; x < 64; ++x)
                largest = std::max(largest, std::abs(a.value(c, T, x, y) - b.value(c, T, x, y)));
        EXPECT_LT(largest, 1e-3) << distance_m;  // u is a float: 1e-7 of a turn, and the levels are rounded
    }
}

TEST(TexturedGlobe, APixelOnAPoleSeesAllMeridians) {
    Scene s = with_texture(make(512, 256, [](int x, int) { return x / 64 % 2; }));
    add_sphere(s, 1, {});
    const Look look(s);
    const Camera c = camera(9, 9, 900);  // 0.01 R a pixel
    for (const double z : {10.0, -10.0}) {
        const Rigid3 T = looking({0, 0, z}, {0, 0, 0}, {0, 1, 0});
        std::mt19937 random(9);
        std::uniform_real_distribution<double> any(-0.05, 0.05);
        EXPECT_NEAR(look.value(c, T, 4, 4), 0.5, 0.1);
        for (int i = 0; i < 500; ++i)
            EXPECT_NEAR(look.value(c, T, 4 + any(random), 4 + any(random)), 0.5, 0.1);  // 15 lookups, 8 sectors
    }
}

TEST(TexturedGlobe, BeamsAtTheLimbDoNotReachAcrossTheFarSide) {
    // White where it is hidden by more than 0.35 rad; a pixel is 0.04 R, so that at the limb half of it covers
    // sqrt(0.04) = 0.2 rad of the globe.
    Scene s = with_texture(globe_map(512, 256, [](const Vec3& n) { return n.x < -std::sin(0.35); }));
    add_sphere(s, 1, {});
    const Look look(s);
    const Camera c = camera(50, 50, 1000 / 0.04);
    const Rigid3 T = looking({1000, 0, 0}, {0, 0, 0});
    std::mt19937 random(9);
    std::uniform_real_distribution<double> angle(0, 2 * kPi), inside(0, 1e-2);
    int seen = 0;
    for (int i = 0; i < 2000; ++i) {
        const double a = angle(random), r = 25 * (1 - std::pow(inside(random), 2)) - 1e-4;
        const double v = look.value(c, T, pinhole_of(c).cx + r * std::cos(a), pinhole_of(c).cy + r * std::sin(a));
        if (v < 0) continue;
        ++seen;
        EXPECT_LT(v, 0.02);
    }
    EXPECT_GT(seen, 1500);
}

TEST(TexturedGlobe, FarAwayItsMeanDoesNotFlickerAsItMovesBySubPixels) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any;
    Scene s = with_texture(make(1024, 512, [&](int, int) { return any(random) < 0.5; }));
    add_sphere(s, 1, {});
    const Look look(s);
    const Camera c = camera(24, 24, 1000);  // 20 px across at 100 m
    const auto disc = [&](bool filter) {
        return spread(64, [&](int i) {
            const Rigid3 T = looking({100, 0, 0}, {0, 0.1 * (i % 8) / 8.0, 0.1 * (i / 8) / 8.0});
            double sum = 0, n = 0;
            for (int y = 0; y < 24; ++y)
                for (int x = 0; x < 24; ++x)
                    if (const double v = look.value(c, T, x, y, filter); v >= 0) sum += v, ++n;
            return sum / n;
        });
    };
    // About 310 pixels of 1300 texels each, or of one texel alone: 0.5 / sqrt(310) = 0.028, with interpolation
    // 0.019.
    const Spread filtered = disc(true);
    EXPECT_LT(filtered.deviation, 0.002);
    EXPECT_NEAR(filtered.mean / mean_of(s.textures[0]), 1, 0.005);
    EXPECT_GT(disc(false).deviation, 0.01);
}

TEST(Surface, WithoutTexturesIsTheMaterial) {
    Scene s;
    Material m = lambert(0.3f);
    m.emission = {1, 2, 3};
    m.specular = {0.1f, 0.2f, 0.3f};  // a kind without a lobe has none, whatever its fields hold
    s.materials.push_back(m);
    m.kind = &kinds::ggx;
    s.materials.push_back(m);
    add_sphere(s, 1, {}, 0);
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const Ray ray{{5, 0.1, 0.2}, {-1, 0, 0}};
    Hit hit = tracer->intersect(placed(s), ray, kInfinity);
    const Surface plain = surface_at(*tracer, placed(s), hit, ray.direction, 1);
    EXPECT_EQ(plain.diffuse, (Rgb{0.3f, 0.3f, 0.3f}));
    EXPECT_EQ(plain.emission, (Rgb{1, 2, 3}));
    EXPECT_EQ(plain.specular, Rgb{});
    EXPECT_EQ(plain.normal, hit.shading_normal);
    EXPECT_EQ(plain.material, &s.materials[0]);
    EXPECT_TRUE(plain.outside);
    hit.material = 1;
    EXPECT_EQ(surface_at(*tracer, placed(s), hit, ray.direction, 1).specular, (Rgb{0.1f, 0.2f, 0.3f}));
}

TEST(Surface, VertexColoursAreLinearBetweenTheCorners) {
    Scene s;
    Material m = lambert(0.5f);
    m.vertex_colours = 0;
    s.materials = {m, lambert(0.5f)};
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}, {2, 2, 0}};
    mesh.faces = {{0, 1, 2}, {1, 3, 2}};
    mesh.face_material = {0, 1};
    mesh.colours = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
    const Rigid3 T{exp_rotation({0.1, -0.2, 0.3}), {100, 200, 300}};
    add_mesh(s, mesh, T);
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer) << tracer.error().text();
    const BodyPoses at = placed(s);
    const auto albedo = [&](double b1, double b2) {
        const Ray ray{T * Vec3{2 * b1, 2 * b2, 5}, T.q * Vec3{0, 0, -1}};
        const Hit hit = tracer->intersect(at, ray, kInfinity);
        EXPECT_EQ(hit.body, 0);
        return surface_at(*tracer, at, hit, ray.direction, 0).diffuse;
    };
    std::mt19937 random(1);
    std::uniform_real_distribution<double> part(0.01, 0.49);
    for (int i = 0; i < 100; ++i) {
        const double b1 = part(random), b2 = part(random);
        const Rgb c = albedo(b1, b2);
        EXPECT_NEAR(c.x, 0.5 * (1 - b1 - b2), 1e-6);
        EXPECT_NEAR(c.y, 0.5 * b1, 1e-6);
        EXPECT_NEAR(c.z, 0.5 * b2, 1e-6);
    }
    EXPECT_EQ(albedo(0.9, 0.9), (Rgb{0.5f, 0.5f, 0.5f})) << "the material without";
    s.meshes[0].colours.pop_back();
    EXPECT_FALSE(Tracer::create(s, 1));
}

TEST(Surface, EmissionTextureMultipliesWhatShines) {
    Scene s;
    Material m = lambert(0.5f);
    m.emission = {10, 20, 30};
    m.emission_texture = 1;
    s.materials.push_back(m);
    s.textures.push_back(make(8, 8, [](int, int) { return 0.9; }));
    s.textures.push_back(make(64, 64, [](int x, int) { return x % 2 ? 0.25 : 0.75; }));
    add_mesh(s, plate(1, 1));
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const Ray ray{{0.1, 0.2, 5}, {0, 0, -1}};
    const Hit hit = tracer->intersect(placed(s), ray, kInfinity);
    ASSERT_EQ(hit.body, 0);
    const Surface far = surface_at(*tracer, placed(s), hit, ray.direction, 0.25);  // 16 texels
    EXPECT_NEAR(far.emission.x, 5, 0.01);
    EXPECT_NEAR(far.emission.z, 15, 0.03);
    EXPECT_EQ(far.diffuse, (Rgb{0.5f, 0.5f, 0.5f})) << "only what the material names";
    const Surface near = surface_at(*tracer, placed(s), hit, ray.direction, 0.001);
    EXPECT_NEAR(near.emission.x, 10 * texture_lookup(s.textures[1], hit.u, hit.v).x, 1e-5);
}

}  // namespace
}  // namespace narpa
