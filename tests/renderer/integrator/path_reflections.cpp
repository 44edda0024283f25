// Paths over glossy surfaces, mirrors and glass, against quadrature and the formulas of ray optics.
#include "base/constants.h"
#include "renderer/material/bsdf.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace test;
Material metal(float roughness) {
    Material m = lambert(0.8f);
    m.kind = &kinds::ggx;
    m.metallic = 1;
    m.roughness = roughness;
    return m;
}

// Light sampling finds a small lamp best in rough surfaces, the BSDF in glossy ones: multiple importance sampling
// must be right, and good, in all of them. The expected value is f cos L integrated over a fine grid of the lamp.
class Glossy : public testing::TestWithParam<std::pair<const char*, Material>> {};

TEST_P(Glossy, ReflectionOfALampIsItsQuadrature) {
    const Vec3 eye{-1.5, 0.2, 1}, view = normalized(eye);
    for (const double size : {0.05, 1.0}) {
        for (const bool emissive_body : {false, true}) {
            Scene s;
            s.materials.push_back(GetParam().second);
            s.materials.push_back(shining(0, {7, 7, 7}));
            add_mesh(s, plate(2, 2));
            const Rigid3 T = looking({1.5, -0.1, 1.1}, {0, 0, 0});
            if (emissive_body) {
                Mesh panel = plate(size, size);
                panel.face_material.assign(panel.faces.size(), 1);
                add_mesh(s, std::move(panel), T);
            } else {
                Light l;
                l.kind = Light::Kind::rectangle;
                l.width_m = l.height_m = size;
                l.T_mount_light = T;
                l.emission = {7, 7, 7};
                s.lights.push_back(l);
            }
            Surface surface;
            surface.material = &s.materials[0];
            surface.diffuse = s.materials[0].diffuse;
            surface.specular = s.materials[0].specular;
            surface.exponent = s.materials[0].exponent;
            surface.normal = {0, 0, 1};
            const int n = 400;
            double expected = 0;
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const Vec3 p = T * Vec3{size * ((i + 0.5) / n - 0.5), size * ((j + 0.5) / n - 0.5), 0};
                    const Vec3 l = normalized(p);
                    const double area = size * size / (static_cast<double>(n) * n);
                    expected += static_cast<double>(bsdf(surface, {0, 0, 1}, l, view).x) * l.z * 7 * area *
                                -dot(l, T.q * Vec3{0, 0, 1}) / dot(p, p);
                }
            const Estimate e = light_along(s, {eye, -view}, kDirectLight, 2048);
            EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 2e-4 * expected)
                << GetParam().first << ' ' << size << ' ' << emissive_body;
            EXPECT_LT(e.error, 0.01 * expected) << GetParam().first << ' ' << size << ' ' << emissive_body;
        }
    }
}
INSTANTIATE_TEST_SUITE_P(Materials, Glossy,
                         testing::Values(std::pair{"lambert", lambert(0.5f)},
                                         std::pair{"phong 1", phong(0.1f, 0.8f, 1)},
                                         std::pair{"phong 30", phong(0.1f, 0.8f, 30)},
                                         std::pair{"phong 1000", phong(0, 0.8f, 1000)},
                                         std::pair{"metal 0.2", metal(0.2f)}, std::pair{"metal 0.6", metal(0.6f)}));

// A lamp seen over exactly k reflections between two mirrors that face each other: reflectance^k, and black beyond
// the greatest depth.
TEST(ParallelMirrors, ShowTheLampAfterUpToFortyReflections) {
    for (const float reflectance : {1.0f, 0.99f}) {
        Scene s;
        s.materials.push_back(mirror(reflectance));
        add_mesh(s, plate(100, 10));
        add_mesh(s, plate(100, 10), {exp_rotation({kPi, 0, 0}), {0, 0, 1}});
        for (const int k : {1, 2, 7, 39, 40}) {
            Scene lit = s;
            // The ray climbs or falls by 1 m each metre to the right, from half way up: it reflects at 0.5, 1.5 ...
            // m.
            Light l;
            l.kind = Light::Kind::rectangle;
            l.T_mount_light = looking({static_cast<double>(k), 0, 0.5}, {0, 0, 0.5});
            l.width_m = l.height_m = 0.8;
            l.emission = {3, 3, 3};
            lit.lights.push_back(l);
            const Ray ray{{0, 0, 0.5}, normalized(Vec3{1, 0, -1})};
            PathSettings settings;
            settings.max_depth = 40;
            EXPECT_NEAR(light_along(lit, ray, settings, 1).mean.x,
                        3 * std::pow(static_cast<double>(reflectance), k), 2e-5)
                << k;
            settings.max_depth = k;
            EXPECT_GT(light_along(lit, ray, settings, 1).mean.x, 2) << k;
            settings.max_depth = k - 1;
            EXPECT_EQ(light_along(lit, ray, settings, 1).mean.x, 0) << k;
        }
    }
}

TEST(RussianRoulette, KeepsTheMeanOfEveryBand) {
    // Paths here are judged by the brightest band; the dim ones must come out right all the same. Emission e in a
    // closed sphere of albedo a is e / (1 - a) in all.
    Scene s;
    s.materials.push_back(shining(0, {1, 1, 1}));
    s.materials[0].diffuse = {0.5f, 0.3f, 0.02f};
    add_sphere(s, 1, {});
    PathSettings settings;
    settings.max_depth = 40;
    const Estimate e = light_along(s, ray_to({}, {1, 1, 1}), settings, 4096);
    EXPECT_GT(e.error, 0);  // some did end
    EXPECT_NEAR(e.mean.x, 1 / (1 - 0.5), kSigmas * e.error + 1e-5);
    EXPECT_NEAR(e.mean.y, 1 / (1 - 0.3), kSigmas * e.error + 1e-5);
    EXPECT_NEAR(e.mean.z, 1 / (1 - 0.02), kSigmas * e.error + 1e-5);
}

/// The way of light through the sphere without reflection: point and direction where it leaves. The path's own
/// pieces: the tracer's hits, the material's directions, the other side of each surface.
Ray through_sphere(const RenderScene& render_scene, const BodyPoses& at, const Ray& in) {
    Hit hit = render_scene.tracer().intersect(at, in, kInfinity);
    Vec3 d = in.direction;
    for (int surface = 0; surface < 2; ++surface) {
        EXPECT_EQ(hit.body, 0);
        Surface s;
        s.material = &render_scene.scene().materials[0];
        s.normal = hit.shading_normal;
        s.outside = hit.outside;
        EXPECT_EQ(hit.outside, surface == 0);
        const BsdfSample through = sample_bsdf(s, s.normal, -d, {0.999999, 0.5, 0.5});
        EXPECT_TRUE(through.transmitted);
        d = through.l;
        const Hit from = other_side(hit);
        if (surface == 1) return {hit.position, d};
        HitBatch batch;
        batch.put(0, from);
        Vec3Lanes directions{};
        directions.put(0, d);
        render_scene.tracer().intersect(at, batch, directions, 1u, batch);
        hit = batch[0];
    }
    return {};
}

TEST(GlassSphere, TurnsRaysAsSnellSaysAndFocusesParaxialOnes) {
    for (const double n : {1.33, 1.5, 1.9}) {
        for (const double radius : {1.0, 1e-3, 2e3}) {
            Scene s;
            s.materials.push_back(glass(static_cast<float>(n)));
            const double ior = static_cast<double>(static_cast<float>(n));
            add_sphere(s, radius, {});
            const auto render_scene = RenderScene::create(s, 1);
            ASSERT_TRUE(render_scene);
            for (const double b : {0.1, 0.3, 0.6, 0.9}) {  // impact parameter over radius
                const Ray in{{-3 * radius, b * radius, 0}, {1, 0, 0}};
                const Ray out = through_sphere(*render_scene, placed(s), in);
                // Turned by twice the difference of the angles of incidence and refraction, both the same at the
                // far side.
                const double turned = 2 * (std::asin(b) - std::asin(b / ior));
                EXPECT_NEAR(std::atan2(-out.direction.y, out.direction.x), turned, 1e-9) << n << ' ' << b;
                EXPECT_NEAR(out.direction.z, 0, 1e-12);
            }
            // Effective focal length n r / (2 (n - 1)) from the centre; the aberration goes as the height squared.
            const double b = 1e-3;
            const Ray out = through_sphere(*render_scene, placed(s), {{-3 * radius, b * radius, 0}, {1, 0, 0}});
            const double crossing = out.origin.x - out.origin.y * out.direction.x / out.direction.y;
            EXPECT_NEAR(crossing / (ior * radius / (2 * (ior - 1))), 1, 5e-6) << n;
        }
    }
}

TEST(GlassSphere, SendsTheLampThroughItsCentreByFresnelAlone) {
    // Straight through: T = 1 - R at each of two surfaces, and what is reflected inside comes through again: T / (1
    // + R) in all, seen against a dark lamp-less side.
    Scene s;
    s.materials.push_back(glass(1.5f));
    s.materials.push_back(shining(0, {1, 1, 1}));
    add_sphere(s, 1, {});
    Mesh panel = plate(0.2, 0.2);
    panel.face_material.assign(panel.faces.size(), 1);
    add_mesh(s, std::move(panel), looking({0, 0, -5}, {}, {1, 0, 0}));
    PathSettings settings;
    settings.max_depth = 40;
    const double R = 0.04;
    const Estimate e = light_along(s, {{0, 0, 5}, {0, 0, -1}}, settings, 4096);
    EXPECT_NEAR(e.mean.x, (1 - R) / (1 + R), kSigmas * e.error + 1e-5);
    EXPECT_LT(e.error, 2e-3);
}

}  // namespace
}  // namespace narpa
