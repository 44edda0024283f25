// Light in an even environment: what comes back follows from the albedo alone, whatever the shape.
#include "renderer/light/small_body_sampling.h"
#include "renderer/material/bsdf_kind.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace test;

class ClosedRoom : public testing::TestWithParam<std::pair<const char*, float>> {};

// Walls of albedo a that shine with radiance e, on all sides: after n surfaces e (1 + a + ... + a^n).
TEST_P(ClosedRoom, HoldsTheGeometricSeriesOfItsEmission) {
    const auto& [shape, albedo] = GetParam();
    Scene s;
    s.materials.push_back(shining(albedo, {3, 2, 1}));
    if (std::string(shape) == "sphere")
        add_sphere(s, 2, {});
    else if (std::string(shape) == "box")
        add_mesh(s, box(3, 4, 5));
    else
        add_mesh(s, icosphere(2, 2, true));
    for (const int depth : {1, 3, 40}) {
        PathSettings settings;
        settings.max_depth = depth;
        const Estimate e = light_along(s, ray_to({0.3, 0.2, -0.1}, {1, 1, 0.4}), settings, 256);
        const double a = static_cast<double>(albedo), sum = (1 - std::pow(a, depth + 1)) / (1 - a);
        EXPECT_NEAR(e.mean.x, 3 * sum, kSigmas * e.error + 1e-5 * sum) << depth;
        EXPECT_LT(e.error, 0.02 * sum) << depth;
        EXPECT_NEAR(e.mean.z, sum, kSigmas * e.error / 3 + 1e-5 * sum) << depth;
    }
}
INSTANTIATE_TEST_SUITE_P(Shapes, ClosedRoom,
                         testing::Values(std::pair{"sphere", 0.5f}, std::pair{"box", 0.5f},
                                         std::pair{"smooth", 0.5f}, std::pair{"sphere", 0.2f},
                                         std::pair{"box", 0.8f}));

/// Radiance at many places of a body about the origin in an even sky, seen from `eye`.
void expect_sky_colour(const Scene& s, const Vec3& eye, double tolerance) {
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    PathSettings settings;
    settings.max_depth = 40;
    for (int i = 0; i < 24; ++i) {
        const double phi = 2.4 * i, r = 0.99 * std::sqrt((i + 0.5) / 24);
        const Vec3 target{0, r * std::cos(phi), r * std::sin(phi)};
        const Estimate e = light_along(*render_scene, placed(s), ray_to(eye, target), settings, 16);
        EXPECT_NEAR(e.mean.x, 2, 2 * tolerance) << i;
        EXPECT_NEAR(e.mean.y, 3, 3 * tolerance) << i;
    }
}

TEST(Furnace, AWhiteSphereIsIndistinguishableFromTheBackground) {
    Scene s;
    s.materials.push_back(lambert(1));
    s.ambient = {2, 3, 5};
    add_sphere(s, 1, {});
    expect_sky_colour(s, {4, 0, 0}, 1e-6);
}

TEST(Furnace, AWhiteMeshWithVertexNormalsIsIndistinguishableFromTheBackground) {
    for (const int level : {0, 1, 2}) {
        Scene s;
        s.materials.push_back(lambert(1));
        s.ambient = {2, 3, 5};
        add_mesh(s, icosphere(level, 1, true));
        expect_sky_colour(s, {4, 0.1, 0.2}, 2e-6);
    }
}

TEST(Furnace, SoIsAWhiteBowl) {
    // Seen from within, vertex normals describe a hollow: rays leave from the faces, and some directions above the
    // normal lie behind them.
    for (const int level : {0, 1, 2}) {
        Scene s;
        s.materials.push_back(lambert(1));
        s.ambient = {2, 3, 5};
        Mesh bowl = icosphere(level, 1, true);
        const std::size_t half = bowl.faces.size() / 2;
        bowl.faces.resize(half);
        bowl.face_material.resize(half);
        const auto& [a, b, c] = bowl.faces[half / 3];
        const Vec3 target =
            vec_cast<double>(0.5f * bowl.positions[a] + 0.3f * bowl.positions[b] + 0.2f * bowl.positions[c]);
        add_mesh(s, std::move(bowl));
        PathSettings settings;
        settings.max_depth = 40;
        const Estimate e = light_along(s, ray_to({0, 0, 0}, target), settings, 64);
        EXPECT_NEAR(e.mean.x, 2, 2e-5) << level;  // of paths half leave at each surface: 2^-40 are lost
    }
}

TEST(Furnace, WaveringVertexNormalsNeitherMakeNorLoseLight) {
    // Normals up to 40 degrees off, as a coarse bump map would turn them, over faces that bulge and faces that do
    // not.
    Scene s;
    s.materials.push_back(lambert(1));
    s.ambient = {2, 3, 5};
    Mesh m = icosphere(2, 1, true);
    std::mt19937_64 random(5);
    for (Vec3f& n : m.normals)
        n = vec_cast<float>(normalized(vec_cast<double>(n) + 0.6 * random_direction(random)));
    add_mesh(s, std::move(m));
    expect_sky_colour(s, {4, 0.1, 0.2}, 2e-6);
}

TEST(Furnace, NormalMapsNeitherMakeNorLoseLight) {
    // Texels of normals up to 60 degrees off in all directions, on an exact sphere and on a smooth mesh.
    std::mt19937_64 random(9);
    Texture map;
    map.width = map.height = 16;
    for (int i = 0; i < 16 * 16; ++i) {
        const Vec3 n = normalized(Vec3{0, 0, 1} + 0.85 * random_direction(random));
        for (int k = 0; k < 3; ++k) map.rgb.push_back(static_cast<std::uint16_t>(65535 * (0.5 + 0.5 * n[k])));
    }
    for (const bool mesh : {false, true}) {
        Scene s;
        s.materials.push_back(lambert(1));
        s.materials[0].normal_texture = 0;
        s.textures.push_back(map);
        s.ambient = {2, 3, 5};
        if (mesh) {
            Mesh m = icosphere(2, 1, true);
            for (const Vec3f& p : m.positions) m.uvs.push_back({p.x + 0.3f * p.z, p.y - 0.2f * p.z});
            add_mesh(s, std::move(m));
        } else {
            add_sphere(s, 1, {});
        }
        expect_sky_colour(s, {4, 0.1, 0.2}, 2e-6);
    }
}

TEST(Furnace, NoMaterialReflectsMoreThanItReceives) {
    for (const BsdfKind* kind : {&kinds::lambert, &kinds::phong, &kinds::mirror, &kinds::dielectric, &kinds::ggx,
                                 &kinds::lommel_seeliger, &kinds::lunar_lambert, &kinds::akimov, &kinds::hapke}) {
        Scene s;
        s.materials.push_back(phong(kind == &kinds::phong                                     ? 0.5f
                                    : kind == &kinds::lunar_lambert || kind == &kinds::akimov ? 0.58f
                                    : kind == &kinds::hapke                                   ? 0.9f
                                                                                              : 1,
                                    0.5f, 8));
        s.materials[0].kind = kind;
        s.materials[0].metallic = 1;
        s.ambient = {1, 1, 1};
        add_mesh(s, bumpy(3, 1, 0.3));
        const auto render_scene = RenderScene::create(s, 1);
        ASSERT_TRUE(render_scene);
        for (const Vec3& target : {Vec3{0, 0, 0}, Vec3{0, 0.5, 0.3}, Vec3{0, -0.3, 0.8}, Vec3{0, 0.2, -0.9}}) {
            const Estimate e =
                light_along(*render_scene, placed(s), ray_to({4, 0.1, 0.2}, target), {.max_depth = 40}, 256);
            EXPECT_LT(e.mean.x, 1 + kSigmas * e.error + 1e-4) << kind->name;
            EXPECT_GT(e.mean.x, 0.05) << kind->name;
        }
    }
}

TEST(Furnace, ASmallBodyInTheSkyNeitherMakesNorLosesLight) {
    // It is as bright as the sky; the Sun, by which rays are sent to it, is all but dark.
    for (const float roughness : {0.3f, 0.6f, 1.0f}) {
        Scene s;
        s.materials = {lambert(1), lambert(1)};
        s.materials[0].kind = &kinds::ggx;
        s.materials[0].metallic = 1;
        s.materials[0].roughness = roughness;
        s.ambient = {1, 1, 1};
        add_sun(s, {0, 1, 0}, 1e-9);
        add_sphere(s, 1, {});
        const Ray ray = ray_to({4, 0, 0}, {0, 0.5, 0.6});
        const PathSettings settings{.max_depth = 8};
        const Estimate alone = light_along(s, ray, settings, 2048);
        add_sphere(s, 0.05, {100, 0, 0}, 1);
        ASSERT_TRUE(SmallBodySampling::may_help(RenderScene::create(s, 1)->tracer(), placed(s)));
        const Estimate both = light_along(s, ray, settings, 2048);
        EXPECT_NEAR(both.mean.x, alone.mean.x, kSigmas * std::hypot(alone.error, both.error) + 1e-6) << roughness;
        EXPECT_LT(both.error, 0.01);
    }
}

TEST(Furnace, AGlassSphereIsIndistinguishableFromTheBackground) {
    // Fresnel's reflectance and transmittance add up to one, and what refraction does to radiance on the way in it
    // undoes on the way out. Paths of more than 40 surfaces are lost: R^39 of them.
    Scene s;
    s.materials.push_back(glass(1.5f));
    s.ambient = {2, 3, 5};
    add_sphere(s, 1, {});
    expect_sky_colour(s, {4, 0, 0}, 1e-5);
}

TEST(Furnace, MirrorsAndPhongKeepTheirAlbedo) {
    Scene s;
    s.materials.push_back(mirror(0.75f));
    s.ambient = {2, 3, 5};
    add_sphere(s, 1, {});
    PathSettings settings;
    const Ray ray = ray_to({4, 0, 0}, {0, 0.3, 0.4});
    EXPECT_NEAR(light_along(s, ray, settings, 1).mean.x, 1.5, 1e-6);
    for (const float exponent : {1.0f, 50.0f, 1e4f}) {
        s.materials[0] = phong(0.3f, 0.6f, exponent);
        const Estimate e = light_along(s, ray, settings, 1024);
        EXPECT_LE(e.mean.x, 2 * 0.9 + kSigmas * e.error) << exponent;
        EXPECT_GT(e.mean.x, 2 * 0.3) << exponent;
    }
}

TEST(Sky, IsSeenByTheCameraAndDimmedByNothing) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    s.ambient = {2, 3, 5};
    add_sphere(s, 1, {});
    EXPECT_EQ(light_along(s, {{4, 0, 0}, {1, 0, 0}}, {}, 1).mean, (Vec3{2, 3, 5}));
}

}  // namespace
}  // namespace narpa
