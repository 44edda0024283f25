// The Sun's disc, planets that light each other, and scenes far from the origin.
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "base/constants.h"
#include "renderer/integrator/shading.h"
#include "renderer/light/lights.h"
#include "renderer/material/bsdf.h"
#include "tests/renderer/integrator/path_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

using namespace test;
constexpr double kSolar = 1361;
TEST(SunDisc, IsSeenByTheCameraAndInAMirrorWithItsRadiance) {
    Scene s;
    s.materials.push_back(mirror(0.9f));
    s.ambient = {2, 2, 2};
    add_mesh(s, plate(2, 2));
    const Vec3 sun = normalized(Vec3{0.3, 0, 1});
    add_sun(s, sun);
    const double half = 0.5 * s.sun->angular_diameter_rad, radiance = kSolar / (kPi * std::pow(std::sin(half), 2));
    const auto seen = [&](double off) {  // the camera's ray, off the Sun's centre by this angle
        const Vec3 d = exp_rotation({0, off, 0}) * sun;
        return light_along(s, {{5, 0, 1}, d}, {}, 1).mean.x;
    };
    EXPECT_NEAR(seen(0), 2 + radiance, 1e-6 * radiance);
    EXPECT_NEAR(seen(0.999 * half), 2 + radiance, 1e-6 * radiance);
    EXPECT_EQ(seen(1.001 * half), 2);
    const Vec3 down{sun.x, sun.y, -sun.z};
    EXPECT_NEAR(light_along(s, {-2.0 * down, down}, {}, 1).mean.x, 0.9 * (2 + radiance), 1e-6 * radiance);
}

TEST(SunDisc, ItsIrradianceIsTheSamePointOrDisc) {
    for (const double diameter : {0.0, 0.0093, 0.5}) {
        Scene s;
        s.materials.push_back(lambert(1));
        add_mesh(s, plate(2, 2));
        add_sun(s, {0.5, 0, 1});
        s.sun->angular_diameter_rad = diameter;
        const Estimate e = light_along(s, ray_to({0, 0.1, 1}, {}), kDirectLight, 256);
        EXPECT_NEAR(e.mean.x, kSolar / kPi / std::sqrt(1.25), 1e-3 + kSigmas * e.error) << diameter;
    }
}

TEST(SunDisc, CastsThePenumbraOfAnEdge) {
    // A half plane 10 m above a plate: at signed distance d from the edge's shadow the disc is cut at d / (10
    // tan(half)).
    Scene s;
    s.materials.push_back(lambert(1));
    add_mesh(s, plate(2, 2));
    add_mesh(s, plate(100, 100), {{}, {-50, 0, 10}});
    s.materials.push_back(lambert(0));  // or it would shine down
    s.meshes[1].face_material.assign(s.meshes[1].faces.size(), 1);
    add_sun(s, {0, 0, 1});
    const double half = 0.5 * s.sun->angular_diameter_rad;
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    for (const double part : {-1.05, -0.8, -0.3, 0.0, 0.4, 0.9, 1.05}) {
        const double d = part * 10 * std::tan(half), cut = std::clamp(part, -1.0, 1.0);
        const double visible = 1 - (std::acos(cut) - cut * std::sqrt(1 - cut * cut)) / kPi;
        const Estimate e = light_along(*render_scene, placed(s), ray_to({d, 0.3, 1}, {d, 0, 0}), {}, 256);
        // 4096 stratified points of the disc: the edge cuts about sqrt(4096) of their cells.
        EXPECT_NEAR(e.mean.x / (kSolar / kPi), visible, 5e-3) << part;
    }
}

// a lobe of exponent n meets the Sun with a probability of 1e-4 (n = 10): found by asking for it, with no
// clamping.
TEST(SunDisc, GlossySurfacesHaveNoFireflies) {
    for (const float n : {10.0f, 100.0f, 1e3f, 1e4f}) {
        for (const double off : {0.0, 0.02, 0.2}) {  // viewer's distance from the mirror direction
            Scene s;
            s.materials.push_back(phong(0.2f, 0.8f, n));
            add_mesh(s, plate(2, 2));
            add_sun(s, {0, 0, 1});
            const auto render_scene = RenderScene::create(s, 1);
            ASSERT_TRUE(render_scene);
            const Vec3 eye{std::sin(off), 0, std::cos(off)};
            const BodyPoses at = placed(s);
            const Ray ray{eye, -eye};
            const Hit first = render_scene->tracer().intersect(at, ray, kInfinity);
            double sum = 0, squares = 0;
            const int samples = 4096;
            for (int k = 0; k < samples; ++k) {
                const Rgb radiance =
                    light_along(*render_scene, at, ray, first, kDirectLight, 7, static_cast<std::uint32_t>(k), 0);
                sum += static_cast<double>(radiance.x);
                squares += std::pow(static_cast<double>(radiance.x), 2);
            }
            // The disc, cut into rings: the lobe about each point of it.
            const double half = 0.5 * s.sun->angular_diameter_rad, e = static_cast<double>(n);
            double expected = 0;
            const int rings = 400;
            for (int i = 0; i < rings; ++i)
                for (int j = 0; j < rings; ++j) {
                    const double r = std::sin(half) * std::sqrt((i + 0.5) / rings),
                                 phi = 2 * kPi * (j + 0.5) / rings;
                    const Vec3 l{r * std::cos(phi), r * std::sin(phi), std::sqrt(1 - r * r)};
                    const double lobe = std::pow(std::max(0.0, 2 * l.z * eye.z - dot(l, eye)), e);
                    expected += kSolar / (rings * rings) * (0.2 / kPi + 0.8 * (e + 2) / (2 * kPi) * lobe);
                }
            const double mean = sum / samples,
                         deviation = std::sqrt(std::max(0.0, squares / samples - mean * mean));
            EXPECT_NEAR(mean, expected, kSigmas * deviation / std::sqrt(samples) + 1e-4 * expected)
                << n << ' ' << off;
            EXPECT_LT(deviation, mean) << n << ' ' << off;  // sampling the lobe alone: 92 times the mean at n = 10
        }
    }
}

// A moon between the Sun and its planet: its night side is lit by the planet's day side alone. The expected
// radiance is the integral over the planet's lit and visible part, on a fine grid of directions.
TEST(PlanetShine, OnTheMoonsNightSideIsTheIntegralOverThePlanet) {
    const double planet_radius = 3.39e6, moon_radius = 1.1e4;
    for (const double distance : {9.376e6, 1e8, 3.844e8}) {
        Scene s;
        s.materials.push_back(lambert(0.25f));
        s.materials.push_back(lambert(0.07f));
        add_sphere(s, planet_radius, {});
        const Vec3 moon = distance * normalized(Vec3{1, 1, 0});
        add_sphere(s, moon_radius, moon, 1);
        add_sun(s, {1, 0, 0});
        s.sun->angular_diameter_rad = 0.0061;
        const auto render_scene = RenderScene::create(s, 1);
        ASSERT_TRUE(render_scene);
        for (const Vec3& up : {normalized(Vec3{-1, -0.8, 0.3}), normalized(Vec3{-0.1, -1, 0.4})}) {
            const Vec3 p = moon + moon_radius * up;
            const Vec3 to_planet = normalized(-p);
            const double sin_max = planet_radius / norm(p);
            const Vec3 right = normalized(cross(to_planet, {0, 0, 1})), across = cross(to_planet, right);
            double irradiance = 0;
            const int n = 400;
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const double sine = sin_max * std::sqrt((i + 0.5) / n), phi = 2 * kPi * (j + 0.5) / n;
                    const double cosine = std::sqrt(1 - sine * sine);
                    const Vec3 d =
                        sine * std::cos(phi) * right + sine * std::sin(phi) * across + cosine * to_planet;
                    const double b = dot(p, d),
                                 t = -b - std::sqrt(b * b - dot(p, p) + planet_radius * planet_radius);
                    const Vec3 q = normalized(p + t * d);
                    const double lit = std::max(0.0, q.x) * 0.25 * kSolar / kPi;
                    irradiance += lit * std::max(0.0, dot(up, d)) * kPi * sin_max * sin_max / (n * n) / cosine;
                }
            const double expected = 0.07 / kPi * irradiance;
            ASSERT_GT(expected, 0);
            PathSettings settings;
            settings.max_depth = 2;
            const Estimate e = light_along(*render_scene, placed(s), ray_to(p + 1e4 * up, p), settings, 2048);
            EXPECT_NEAR(e.mean.x / expected, 1, 0.01) << distance;
            EXPECT_LT(e.error / expected, 0.004) << distance;
        }
    }
}

/// A scene of every kind of path, a few metres across.
Scene workshop() {
    Scene s;
    s.materials = {lambert(0.6f), phong(0.3f, 0.5f, 40), mirror(0.9f), glass(1.5f), shining(0.4f, {4, 5, 6})};
    s.ambient = {0.3f, 0.2f, 0.1f};
    add_sun(s, {0.4, 0.3, 1});
    add_mesh(s, plate(8, 8, 4));
    Mesh bump = bumpy(3, 0.7, 0.2);
    bump.face_material.assign(bump.faces.size(), 1);
    add_mesh(s, std::move(bump), {normalized(Quat{0.9, 0.1, 0.3, 0.2}), {-1, 0.5, 0.75}});
    add_sphere(s, 0.5, {0.5, 0.5, 0.5}, 2);
    add_sphere(s, 0.5, {0.5, -0.75, 0.5}, 3);
    Mesh panel = plate(0.5, 0.5);
    panel.face_material.assign(panel.faces.size(), 4);
    add_mesh(s, std::move(panel), looking({-1, -2, 2}, {}));
    add_sphere(s, 0.125, {1.5, 0, 1}, 4);
    Light l;
    l.kind = Light::Kind::disc;
    l.mount = 1;
    l.T_mount_light = looking({0, 0, 2}, {0.25, 0, 0}, {0, 1, 0});
    l.emission = {9, 8, 7};
    s.lights.push_back(l);
    return s;
}

constexpr int kGridSide = 12;
/// An image of the workshop, its pixels `together` at a time.
std::vector<Rgb> picture(const RenderScene& render_scene, const BodyPoses& at, const Vec3& offset,
                         std::size_t together, const PathSettings& settings = {}) {
    std::vector<Rgb> pixels(kGridSide * kGridSide);
    tbb::parallel_for(std::size_t{0}, (pixels.size() + together - 1) / together, [&](std::size_t block) {
        const std::size_t from = block * together, n = std::min(together, pixels.size() - from);
        PathRays rays(n);
        std::vector<Rgb> radiance(n);
        for (std::size_t i = 0; i < n; ++i) {
            const std::size_t pixel = from + i;
            const double x = static_cast<double>(pixel % kGridSide) / kGridSide - 0.5,
                         y = static_cast<double>(pixel / kGridSide) / kGridSide - 0.5;
            Ray ray = ray_to({3, -3, 3}, {3 * (x + y), 3 * (x - y), 0.5});
            ray.origin += offset;
            rays.put(i, ray, render_scene.tracer().intersect(at, ray, kInfinity),
                     static_cast<std::uint32_t>(pixel));
        }
        for (std::uint32_t s = 0; s < 8; ++s) {
            rays.trace({render_scene, at, settings, 3}, s, radiance);
            for (std::size_t i = 0; i < n; ++i) pixels[from + i] += radiance[i];
        }
    });
    return pixels;
}

TEST(PathRadiance, OfARayDoesNotDependOnItsNeighboursNorOnThreads) {
    const Scene s = workshop();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const std::vector<Rgb> expected = picture(*render_scene, at, {}, kLanes);
    double lit = 0;
    for (const Rgb& p : expected) {
        EXPECT_TRUE(is_finite(p));
        lit += p != Rgb{};
    }
    EXPECT_GT(lit, 100);
    // Within a batch, within what travels together, and beyond.
    for (const std::size_t together : {1UL, 3UL, 8UL, 40UL, 128UL, 144UL})
        EXPECT_EQ(picture(*render_scene, at, {}, together), expected) << together;
    for (const int threads : {1, 2, 7}) {
        tbb::task_arena arena(threads);
        arena.execute([&] { EXPECT_EQ(picture(*render_scene, at, {}, kLanes), expected) << threads; });
    }
}

TEST(PathRadiance, AllocatesNothing) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "this build's heap is the sanitizer's own";
    const Scene s = workshop();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const Ray ray = ray_to({3, -3, 3}, {0.5, -0.75, 0.5});
    PathRays rays(1);
    rays.put(0, ray, render_scene->tracer().intersect(at, ray, kInfinity), 0);
    Rgb light;
    const auto trace = [&](std::uint32_t sample) { rays.trace({*render_scene, at, {}, 1}, sample, {&light, 1}); };
    trace(0);
    const AllocationCounter counter;
    for (std::uint32_t k = 1; k < 64; ++k) trace(k);
    EXPECT_EQ(counter.on_this_thread(), 0U);
}

TEST(PathRadiance, IsTheSameFarFromTheOrigin) {
    const Scene s = workshop();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    for (const bool direct : {false, true}) {
        const PathSettings settings{.direct = direct};
        const std::vector<Rgb> expected = picture(*render_scene, placed(s), {}, kLanes, settings);
        // All positions of the workshop are multiples of 1/8 m: added to these offsets they stay exact, and so does
        // all else, for only their differences count.
        for (const double far : {1e7, 3.844e8}) {
            const Vec3 offset{far, -0.5 * far, 0.25 * far};
            const std::vector<Rgb> moved = picture(*render_scene, placed(s, offset), offset, kLanes, settings);
            EXPECT_EQ(moved, expected) << far;
        }
    }
}

/// Paths in their plainest form: only the BSDF says where they go on, and light is found by chance.
Vec3 plain_path(const RenderScene& render_scene, const BodyPoses& at, Ray ray, int depth, std::mt19937_64& random) {
    const Scene& scene = render_scene.scene();
    const SunDisc sun(*scene.sun);
    std::uniform_real_distribution<double> number;
    Vec3 radiance{}, throughput{1, 1, 1};
    const auto product = [](const Vec3& a, const Rgb& b) {
        return Vec3{a.x * static_cast<double>(b.x), a.y * static_cast<double>(b.y), a.z * static_cast<double>(b.z)};
    };
    for (int met = 0;; ++met) {
        const Hit hit = render_scene.tracer().intersect(at, ray, kInfinity);
        if (hit.body < 0) {
            const float disc = sun.pdf(ray.direction) > 0 ? sun.radiance() : 0;
            return radiance + product(throughput, scene.ambient + Rgb{disc, disc, disc});
        }
        const Surface s = surface_at(render_scene.tracer(), at, hit, ray.direction, 0);
        radiance += product(throughput, s.emission);
        if (met == depth) return radiance;
        const BsdfSample next =
            sample_bsdf(s, s.normal, -ray.direction, {number(random), number(random), number(random)});
        if (next.weight == Rgb{}) return radiance;
        throughput = product(throughput, next.weight);
        const Hit from = next.transmitted ? other_side(hit) : hit;
        ray = {at.T_world_body[static_cast<std::size_t>(from.body)] * from.departure_body +
                   1e-6 * from.geometric_normal,
               next.l};
    }
}

TEST(PathRadiance, EqualsThatOfBsdfSamplingAlone) {
    // A wide Sun, so that chance finds it; small bodies, so that some rays are guided; lamps of every shape.
    Scene s = workshop();
    s.lights.clear();
    s.sun->angular_diameter_rad = 1;
    s.sun->irradiance_w_m2 = 10;
    add_sphere(s, 0.25, {-1.5, -1, 0.75});
    Body egg;
    egg.shape = exact_ellipsoid({0.25, 0.5, 0.375}, 4);
    egg.initial.T_world_body = {normalized(Quat{0.9, 0.1, 0.3, 0.2}), {1, 1.5, 1}};
    s.bodies.push_back(egg);
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    PathSettings settings;
    settings.max_depth = 4;
    std::mt19937_64 random(11);
    const std::vector<Vec3> targets{{0.5, 0.25, 0.25}, {0.5, -0.75, 0.5}, {-1, 0.5, 0.75},  {1, 0.5, 0},
                                    {1, -0.3, 0},      {-0.5, -1.5, 0},   {-1.5, -1, 0.75}, {0.25, -0.75, 0.25}};
    for (const Vec3& target : targets) {
        const Ray ray = ray_to({3, -3, 3}, target);
        const Estimate e = light_along(*render_scene, at, ray, settings, 512);
        const int samples = 20000;
        Vec3 sum{};
        double squares = 0;
        for (int k = 0; k < samples; ++k) {
            const Vec3 sample = plain_path(*render_scene, at, ray, settings.max_depth, random);
            sum += sample;
            squares += sample.x * sample.x;
        }
        const Vec3 mean = sum / static_cast<double>(samples);
        const double error = std::sqrt(std::max(0.0, squares / samples - mean.x * mean.x) / samples);
        EXPECT_NEAR(e.mean.x, mean.x, 4 * error + kSigmas * e.error) << target.x << ' ' << target.y;
        EXPECT_LT(error + e.error, 0.03 * mean.x);
        EXPECT_NEAR(e.mean.z, mean.z, 0.05 * mean.z) << target.x << ' ' << target.y;
    }
}

TEST(PathRadiance, MethodDirectAddsTheLightsToSunOnlyDirectLighting) {
    // Plate and Sun as in Sun-only direct lighting; even ambient; the body's own glow; one point light on top.
    Scene s;
    s.materials.push_back(shining(0.5f, {1, 2, 3}));
    s.ambient = {10, 20, 30};
    add_mesh(s, plate(2, 2));
    add_mesh(s, plate(2, 2), {exp_rotation({kPi, 0, 0}), {0, 0, 1}});  // hides half the sky and shines down
    add_sun(s, {1, 0, 0.1});
    s.sun->angular_diameter_rad = 0;
    Light l;
    l.kind = Light::Kind::point;
    l.T_mount_light.t = {0, 0, 0.5};
    l.emission = {2, 2, 2};
    s.lights.push_back(l);
    const PathSettings settings{.direct = true};
    const double sunlit = 0.5 * kSolar / kPi * 0.1 / std::sqrt(1.01), lamp = 0.5 / kPi * 2 / 0.25;
    const Estimate e = light_along(s, {{0, 0, 0.25}, {0, 0, -1}}, settings, 4);
    EXPECT_NEAR(e.mean.x, 1 + 5 + sunlit + lamp, 1e-5 * sunlit);
    EXPECT_NEAR(e.mean.y, 2 + 10 + sunlit + lamp, 1e-5 * sunlit);
    EXPECT_EQ(light_along(s, {{0, 0, 0.25}, {0, 1, 0}}, settings, 4).mean, Vec3{});  // black sky
}

}  // namespace
}  // namespace narpa
