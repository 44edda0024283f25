// Normals that textures turn: normal maps in tangent space, and heights in metres.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "renderer/integrator/shading.h"
#include "renderer/material/texture/texture_lookup.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

std::uint16_t code(double x) {
    return static_cast<std::uint16_t>(std::lround(65535 * x));
}

Texture normals_of(const std::vector<Vec3>& n, int width) {
    Texture t{.name = "n", .width = width, .height = static_cast<int>(n.size()) / width, .rgb = {}};
    for (const Vec3& v : n)
        t.rgb.insert(t.rgb.end(), {code(0.5 + 0.5 * v.x), code(0.5 + 0.5 * v.y), code(0.5 + 0.5 * v.z)});
    build_coarser_levels(t);
    return t;
}

template <class Height>  // (x, y) -> 0..65535
Texture heights_of(int width, int height, Height value) {
    Texture t{.name = "h", .width = width, .height = height, .rgb = {}};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) t.rgb.insert(t.rgb.end(), 3, static_cast<std::uint16_t>(value(x, y)));
    build_coarser_levels(t);
    return t;
}

Scene with_normals(Texture t) {
    Scene s;
    Material m = lambert(0.5f);
    m.normal_texture = 0;
    s.materials.push_back(m);
    s.textures.push_back(std::move(t));
    return s;
}

Scene with_heights(Texture t, double height_m) {
    Scene s = with_normals(std::move(t));
    s.materials[0].normal_texture = -1;
    s.materials[0].height_texture = 0;
    s.materials[0].bump_height_m = static_cast<float>(height_m);
    return s;
}

struct Seen {
    Hit hit;
    Surface surface;
};

Seen see(const Scene& s, const Vec3& eye, const Vec3& target, double width_m = 1e-3) {
    const auto tracer = Tracer::create(s, 1);
    EXPECT_TRUE(tracer);
    const BodyPoses at = placed(s);
    const Ray ray{eye, normalized(target - eye)};
    Seen seen;
    seen.hit = tracer->intersect(at, ray, kInfinity);
    EXPECT_GE(seen.hit.body, 0);
    seen.surface = surface_at(*tracer, at, seen.hit, ray.direction, width_m);
    return seen;
}

void expect_near(const Vec3& a, const Vec3& b, double tolerance, const char* what = "") {
    EXPECT_NEAR(norm(a - b), 0, tolerance) << what << ": (" << a.x << ", " << a.y << ", " << a.z << "), not ("
                                           << b.x << ", " << b.y << ", " << b.z << ")";
}

TEST(NormalMap, AFlatOneChangesNothing) {
    for (const std::uint16_t middle : {std::uint16_t{32767}, std::uint16_t{32768}}) {
        Texture t{.name = "flat", .width = 2, .height = 2, .rgb = {}};
        for (int i = 0; i < 4; ++i) t.rgb.insert(t.rgb.end(), {middle, middle, 65535});
        Scene s = with_normals(t);
        add_mesh(s, icosphere(2, 1, true));
        for (const Vec3f& p : s.meshes[0].positions) s.meshes[0].uvs.push_back({p.x, p.y});
        add_sphere(s, 1, {5, 0, 0});
        std::mt19937_64 random(3);
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer);
        for (int i = 0; i < 1000; ++i) {
            const Vec3 centre{i % 2 ? 5.0 : 0.0, 0, 0}, eye = centre + 3.0 * random_direction(random);
            const Vec3 d = normalized(centre + 0.8 * random_direction(random) - eye);
            const Hit hit = tracer->intersect(placed(s), {eye, d}, kInfinity);
            if (hit.body < 0 || dot(hit.shading_normal, d) > -2e-3) continue;
            const Surface seen = surface_at(*tracer, placed(s), hit, d, 0.01);
            expect_near(seen.normal, hit.shading_normal, 1e-6);
            EXPECT_EQ(seen.diffuse, s.materials[0].diffuse);
        }
    }
}

TEST(NormalMap, ATiltIsTheSameOnPlatesTurnedAnyWay) {
    const Vec3 tilt = normalized(Vec3{0.36, -0.48, 0.8});
    std::mt19937_64 random(4);
    for (int i = 0; i < 200; ++i) {
        Scene s = with_normals(normals_of({tilt, tilt}, 2));
        s.materials[0].normal_scale = i % 3 == 2 ? 0.5f : 1;
        Mesh m = plate(2, 3);
        const bool mirrored = i % 2 == 1;
        for (auto& uv : m.uvs)
            if (mirrored) uv[0] = 1 - uv[0];
        const Rigid3 T{random_attitude(random), 10.0 * random_direction(random)};
        add_mesh(s, m, T);
        const double k = static_cast<double>(s.materials[0].normal_scale);
        const Vec3 outwards = T.q * normalized(Vec3{(mirrored ? -k : k) * tilt.x, k * tilt.y, tilt.z});
        for (const double side : {1.0, -1.0}) {  // and from behind it is the same surface
            const Vec3 target = T * Vec3{0.2, 0.3, 0};
            const Seen seen = see(s, target + side * (T.q * Vec3{0.1, 0.2, 4}), target);
            EXPECT_EQ(seen.hit.outside, side > 0);
            expect_near(seen.surface.normal, side * outwards, 5e-5);  // codes of 16 bits
        }
    }
}

TEST(NormalMap, FollowsMeridiansAndParallelsOfAGlobe) {
    const Vec3 tilt = normalized(Vec3{0.2, 0.3, 0.9});
    Scene s = with_normals(normals_of({tilt, tilt, tilt, tilt}, 2));
    add_sphere(s, 2, {1, 2, 3});
    std::mt19937_64 random(5);
    for (int i = 0; i < 100; ++i) {
        const Vec3 n = random_direction(random);
        const Vec3 east = normalized(cross(Vec3{0, 0, 1}, n)), north = cross(n, east);
        const Vec3 centre{1, 2, 3};
        const Seen seen = see(s, centre + 9.0 * n, centre);
        expect_near(seen.surface.normal, tilt.x * east + tilt.y * north + tilt.z * n, 5e-5);
    }
    // The poles have no east: the normal stays as it is.
    for (const double z : {1.0, -1.0}) {
        const Seen seen = see(s, {1, 2, 3 + 9 * z}, {1, 2, 3});
        EXPECT_TRUE(is_finite(seen.surface.normal));
        EXPECT_GT(dot(seen.surface.normal, Vec3{0, 0, z}), 0.8);
    }
}

TEST(NormalMap, IsAveragedAndAPhongLobeWidened) {
    // Normals to the left and to the right by turns: from afar the surface is flat, and blurs what it mirrors.
    const Vec3 left = normalized(Vec3{-0.6, 0, 0.8}), right = normalized(Vec3{0.6, 0, 0.8});
    std::vector<Vec3> normals;
    for (int i = 0; i < 64 * 64; ++i) normals.push_back(i % 2 ? left : right);
    Scene s = with_normals(normals_of(normals, 64));
    s.materials[0].kind = &kinds::phong;
    s.materials[0].exponent = 1000;
    add_mesh(s, plate(1, 1));
    const Seen far = see(s, {0.1, 0.2, 5}, {0.1, 0.2, 0}, 0.2);
    expect_near(far.surface.normal, {0, 0, 1}, 1e-3);
    const double length = 0.8 + 1.0 / 255;  // Toksvig 2005, with the allowance for 8-bit codes
    EXPECT_NEAR(far.surface.exponent, 1000 * length / (length + 1000 * (1 - length)), 0.01);
    const Seen near = see(s, {0.5 / 64, 0.2, 5}, {0.5 / 64, 0.2, 0}, 1e-5);
    expect_near(near.surface.normal, right, 1e-4);
    EXPECT_EQ(near.surface.exponent, 1000);
    s.materials[0].kind = &kinds::phong_classic;
    EXPECT_EQ(see(s, {0.1, 0.2, 5}, {0.1, 0.2, 0}, 0.2).surface.exponent, 1000);
}

TEST(HeightMap, OfARampGivesItsSlope) {
    // 256 codes a texel: 65536 / 65535 of the full height over the whole width, exactly.
    const Texture ramp = heights_of(256, 256, [](int x, int) { return 256 * x; });
    std::mt19937_64 random(6);
    for (const double height_m : {0.5, -2.0, 10.0})
        for (int i = 0; i < 30; ++i) {
            Scene s = with_heights(ramp, height_m);
            const Rigid3 T{random_attitude(random), 10.0 * random_direction(random)};
            Mesh m = plate(4, 2);
            const bool mirrored = i % 2 == 1;
            for (auto& uv : m.uvs)
                if (mirrored) uv[0] = 1 - uv[0];
            add_mesh(s, m, T);
            const double slope = (mirrored ? -1 : 1) * height_m / 4 * 65536 / 65535;
            const Vec3 expected = T.q * normalized(Vec3{-slope, 0, 1}), target = T * Vec3{0.3, 0.1, 0};
            for (const double width_m : {0.0, 1e-3, 0.05, 0.3}) {
                // Towards the normal, so that the viewer sees it from either side.
                expect_near(see(s, target + 5.0 * expected, target, width_m).surface.normal, expected, 2e-4,
                            "front");
                expect_near(see(s, target - 5.0 * expected, target, width_m).surface.normal, -expected, 2e-4,
                            "back");
            }
        }
}

TEST(HeightMap, OfARampAlongVRisesWithV) {
    Scene s = with_heights(heights_of(64, 64, [](int, int y) { return 1024 * (63 - y); }), 0.5);
    add_mesh(s, plate(2, 1));
    const Seen seen = see(s, {0, 0, 5}, {0, 0, 0});
    expect_near(seen.surface.normal, normalized(Vec3{0, -0.5, 1}), 2e-4);
}

TEST(HeightMap, FromAfarShowsTheSlopeOfTheMeanHeight) {
    // Saw teeth of 2 texels on a ramp: the beam covers 8 texels and sees the ramp.
    Scene s = with_heights(heights_of(256, 256, [](int x, int) { return 200 * x + 10000 * (x % 2); }), 1);
    add_mesh(s, plate(1, 1));
    const double ramp = 256 * 200.0 / 65535;
    expect_near(see(s, {0.1, 0, 5}, {0.1, 0, 0}, 8.0 / 256).surface.normal, normalized(Vec3{-ramp, 0, 1}), 2e-3);
    EXPECT_GT(std::abs(see(s, {0.1, 0, 5}, {0.1, 0, 0}, 1e-5).surface.normal.x), 0.95) << "near: a tooth";
}

TEST(HeightMap, RoundedHeightsAreNoCliffsAtThePolesOfAGlobe) {
    // A level globe whose heights are off by a code of 8 bits here and there: 1/255 over a texel of pi / 256.
    std::mt19937_64 random(7);
    std::uniform_int_distribution<int> any(128, 129);
    Scene s = with_heights(heights_of(512, 256, [&](int, int) { return 257 * any(random); }), 0.1);
    add_sphere(s, 1, {});
    const auto tilt = [&](double colatitude) {
        double most = 0;
        for (int i = 0; i < 200; ++i) {
            const double longitude = 0.1 * i;
            const Vec3 n{std::sin(colatitude) * std::cos(longitude), std::sin(colatitude) * std::sin(longitude),
                         std::cos(colatitude)};
            most = std::max(most, norm(see(s, 3.0 * n, {}, 0.0).surface.normal - n));
        }
        return most;
    };
    const double steepest = 0.1 / 255 / (3.14159265 / 256) * std::sqrt(2.0);
    for (const double colatitude : {1.5, 0.3, 0.05, 0.01, 0.001, 3.14})
        EXPECT_LT(tilt(colatitude), steepest) << colatitude;
    EXPECT_GT(tilt(1.5), 0.3 * steepest);
}

TEST(TurnedNormals, StayOnTheViewersSide) {
    std::mt19937_64 random(8);
    std::uniform_int_distribution<int> any(0, 65535);
    Scene s = with_normals(heights_of(32, 32, [&](int, int) { return any(random); }));
    for (std::uint16_t& c : s.textures[0].rgb) c = static_cast<std::uint16_t>(any(random));  // any direction at all
    s.textures.push_back(heights_of(32, 32, [&](int, int) { return any(random); }));
    s.materials.push_back(s.materials[0]);
    s.materials[1].height_texture = 1;
    s.materials[1].bump_height_m = 0.3f;
    Mesh m = icosphere(3, 1, true);
    for (const Vec3f& p : m.positions) m.uvs.push_back({3 * p.x, 3 * p.y});
    for (std::size_t i = 0; i < m.faces.size(); ++i) m.face_material[i] = i % 2;
    add_mesh(s, m);
    add_sphere(s, 1, {3, 0, 0}, 1);
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    int seen = 0, turned_far = 0;
    for (int i = 0; i < 200000 && seen < 100000; ++i) {
        const Vec3 centre{i % 2 ? 3.0 : 0.0, 0, 0};
        const Vec3 eye = centre + (i % 5 == 0 ? 0.4 : 3.0) * random_direction(random);  // from inside too
        const Vec3 d = normalized(centre + 0.98 * random_direction(random) - eye);
        const Hit hit = tracer->intersect(at, {eye, d}, kInfinity);
        if (hit.body < 0) continue;
        ++seen;
        const Vec3 n = surface_at(*tracer, at, hit, d, 1e-3 * (i % 97)).normal;
        ASSERT_GE(-dot(n, d), 0.999e-3);
        ASSERT_NEAR(norm(n), 1, 1e-9);
        turned_far += dot(n, hit.shading_normal) < 0.7;
    }
    EXPECT_EQ(seen, 100000);
    EXPECT_GT(turned_far, 10000);
}

TEST(TurnedNormals, WithoutCoordinatesStayAsTheyAre) {
    Scene s = with_normals(normals_of({{0.6, 0, 0.8}}, 1));
    add_mesh(s, box(2, 2, 2));  // none at all
    expect_near(see(s, {0.1, 0.2, 5}, {0.1, 0.2, 0}).surface.normal, {0, 0, 1}, 1e-12);
    Scene collapsed = with_normals(normals_of({{0.6, 0, 0.8}}, 1));
    Mesh m = plate(2, 2);
    for (auto& uv : m.uvs) uv = {0.5f, 0.5f};
    add_mesh(collapsed, m);
    expect_near(see(collapsed, {0.1, 0.2, 5}, {0.1, 0.2, 0}).surface.normal, {0, 0, 1}, 1e-12);
}

}  // namespace
}  // namespace narpa
