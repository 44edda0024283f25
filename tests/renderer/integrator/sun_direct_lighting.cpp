// Batches aim and shade sixteen lanes together with the results of the functions for one ray.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include "base/fast_math.h"
#include "renderer/frame/camera_rays.h"
#include "renderer/integrator/batch_sampler.h"
#include "renderer/integrator/shading.h"
#include "renderer/material/bsdf.h"
#include "tests/support/lens_ray.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

TEST(FastMath, SineAndCosineOfTurnsTo4e16) {
    std::mt19937_64 random(1);
    double worst = 0;
    for (int i = 0; i < 400000; ++i) {
        const double turns = i < 65 ? (i - 32) * 0.125 : 4 * std::generate_canonical<double, 53>(random) - 2;
        const long double angle = 2 * std::numbers::pi_v<long double> * static_cast<long double>(turns);
        const auto [s, c] = sincos_of_turns(turns);
        worst = std::max({worst, std::abs(static_cast<double>(s - std::sin(angle))),
                          std::abs(static_cast<double>(c - std::cos(angle)))});
    }
    EXPECT_LT(worst, 4e-16);
    EXPECT_EQ(sincos_of_turns(0.25).sin, 1);
    EXPECT_EQ(sincos_of_turns(0.5).cos, -1);
    EXPECT_EQ(sincos_of_turns(0).sin, 0);
}

TEST(FastMath, PowersOfTheUnitIntervalTo1e9) {
    std::mt19937_64 random(2);
    const auto uniform = [&] { return std::generate_canonical<double, 53>(random); };
    double worst = 0;
    for (int i = 0; i < 200000; ++i) {
        const double x = i % 2 == 0 ? 1 - std::pow(10, -8 * uniform()) : std::pow(10, -12 * uniform());
        const double n = std::pow(10, 6 * uniform() - 1);
        if (!(x > 0)) continue;
        const long double exact = std::pow(static_cast<long double>(x), static_cast<long double>(n));
        if (exact < 1e-290L) continue;
        worst = std::max(worst, std::abs(static_cast<double>(unit_power(x, n) / exact - 1)));
    }
    EXPECT_LT(worst, 1e-9);
    EXPECT_EQ(unit_power(1, 1e5), 1);
    EXPECT_EQ(unit_power(0.3, 0), 1);
    EXPECT_EQ(unit_power(1e-300, 100), 0);
    EXPECT_NEAR(unit_power(0.5, 20), 0x1p-20, 1e-20);
}

/// Any pixels and samples.
CameraSamples some_samples(std::size_t n, const Camera& c, std::uint32_t most, std::mt19937_64& random) {
    CameraSamples s;
    s.n = n;
    for (std::size_t i = 0; i < kLanes; ++i) {
        s.x[i] = static_cast<int>(random() % static_cast<unsigned>(c.width));
        s.y[i] = static_cast<int>(random() % static_cast<unsigned>(c.height));
        s.number[i] = static_cast<std::uint32_t>(s.y[i] * c.width + s.x[i]);
        s.sample[i] = static_cast<std::uint32_t>(random() % most);
    }
    return s;
}

TEST(BatchSampler, EqualsThePixelSamplers) {
    std::mt19937_64 random(3);
    for (const std::uint64_t most : {1ull, 7ull, 300ull, 1ull << 32})
        for (const std::uint32_t group : {0u, 1u, 9u}) {
            Lanes<std::uint32_t> pixel, sample;
            for (auto& p : pixel) p = static_cast<std::uint32_t>(random());
            for (auto& s : sample) s = static_cast<std::uint32_t>(random() % most);
            const std::size_t n = 1 + random() % kLanes;
            const std::uint64_t seed = random();
            const BatchSampler sampler(seed, 5, n, pixel, sample);
            BatchSampler::Points u;
            group == 0 ? sampler.points(u) : sampler.points(group, u);
            for (std::size_t i = 0; i < n; ++i) {
                const SamplePoint one = PixelSampler(seed, 5, pixel[i]).point(sample[i], group);
                for (std::size_t dim = 0; dim < 4; ++dim) ASSERT_EQ(u[dim][i], one[dim]) << i << " " << dim;
            }
            if (group == 0) continue;
            Lanes<double> first;
            sampler.first_dimension(group, first);
            for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(first[i], u[0][i]);
        }
}

/// A sphere and plates of every kind of material, so that batches see several at once.
Scene motley() {
    Scene s;
    Material m = lambert(0.6f);
    m.emission = {1, 2, 3};
    s.materials.push_back(m);
    m = lambert(0.2f);
    m.kind = &kinds::phong;
    m.specular = {0.3f, 0.4f, 0.5f};
    m.exponent = 40;
    s.materials.push_back(m);
    m.exponent = 5000;
    s.materials.push_back(m);
    for (const auto kind :
         {&kinds::phong_classic, &kinds::ggx, &kinds::hapke, &kinds::lommel_seeliger, &kinds::mirror}) {
        m.kind = kind;
        s.materials.push_back(m);
    }
    m = lambert(0.7f);
    m.texture = 0;
    s.materials.push_back(m);
    Texture checks{"checks", 2, 2, {65535, 0, 9000, 30000, 20000, 10000, 5, 6, 7, 800, 60000, 50000}};
    s.textures.push_back(checks);
    for (std::size_t i = 0; i < s.materials.size(); ++i) {
        const double x = static_cast<double>(i % 3) - 1, y = static_cast<double>(i / 3) - 1;
        add_sphere(s, 0.55, {x, y, 0.1 * x * y}, static_cast<int>(i));
    }
    s.ambient = {0.5f, 1, 2};
    add_sun(s, {1, 0.3, 0.4});
    return s;
}

struct BlockerStage {
    Scene scene = motley();
    RenderScene render_scene;
    BodyPoses at;
    Camera view;
    Rigid3 T;
    FrameSettings settings;

    explicit BlockerStage(Camera c)
        : render_scene(*RenderScene::create(scene, 1)),
          at(placed(scene)),
          view(c),
          T(looking({0.3, 0.2, 6}, {}, {0, 1, 0})) {
        settings.spp = 16;
        settings.seed = 11;
        settings.frame = 3;
    }
};

/// Rays and first hits, of all bodies.
void trace(const Frame& f, const CameraSamples& s, TracedRays& p) {
    aim_rays(f, s, p);
    find_first_hits(f, f.tracer.all_bodies(), p);
}

TEST(CameraBatch, RaysEqualThoseOfSinglePixels) {
    std::mt19937_64 random(4);
    Camera pinhole = camera(200, 160, 400), lens = pinhole;
    lens.optics.lens = Lens{0.05, 6};
    for (const Camera& c : {pinhole, lens}) {
        const BlockerStage stage(c);
        const Frame f = make_frame(stage.render_scene, stage.at, stage.view, stage.T, stage.settings);
        auto p = std::make_unique<TracedRays>();
        for (int round = 0; round < 200; ++round) {
            CameraSamples s = some_samples(1 + random() % kLanes, c, 40, random);
            s.centre = round % 4 == 0;
            trace(f, s, *p);
            ASSERT_EQ(p->rays.n, s.n);
            for (std::size_t i = 0; i < s.n; ++i) {
                const PixelSampler sampler(stage.settings.seed, stage.settings.frame, s.number[i]);
                const SamplePoint u = sampler.point(s.sample[i]);
                // Centres of a frame of several samples still have their own points of the lens and of the Sun.
                const double x = s.centre ? s.x[i] : s.x[i] + u[0] - 0.5;
                const double y = s.centre ? s.y[i] : s.y[i] + u[1] - 0.5;
                Ray ray = camera_ray(c, stage.T, x, y);
                Vec3 sun = f.sun->sample(u[2], u[3]);
                if (c.optics.lens) {
                    ray = lens_ray(c, *c.optics.lens, stage.T, x, y, aperture_point(*c.optics.lens, u[2], u[3]));
                    const SamplePoint more = sampler.point(s.sample[i], 2);
                    sun = f.sun->sample(more[2], more[3]);
                }
                ASSERT_EQ(p->rays[i].origin, ray.origin);
                ASSERT_EQ(p->rays[i].direction, ray.direction);
                ASSERT_EQ(p->to_sun[i], sun);
            }
        }
    }
}

TEST(CameraBatch, OneSampleGoesThroughAllCentres) {
    std::mt19937_64 random(7);
    Camera c = camera(200, 160, 400);
    c.optics.lens = Lens{0.05, 6};
    BlockerStage stage(c);
    stage.settings.spp = 1;
    const Frame f = make_frame(stage.render_scene, stage.at, stage.view, stage.T, stage.settings);
    auto p = std::make_unique<TracedRays>();
    CameraSamples s = some_samples(kLanes, c, 1, random);
    s.centre = true;
    trace(f, s, *p);
    for (std::size_t i = 0; i < s.n; ++i) {
        const Ray ray = camera_ray(c, stage.T, s.x[i], s.y[i]);
        ASSERT_EQ(p->rays[i].origin, ray.origin);
        ASSERT_EQ(p->rays[i].direction, ray.direction);
        ASSERT_EQ(p->to_sun[i], f.sun->centre());
    }
}

TEST(BatchRadiance, EqualsThatOfOneRayAtATime) {
    std::mt19937_64 random(5);
    const BlockerStage stage(camera(64, 64, 100));
    const Frame f = make_frame(stage.render_scene, stage.at, stage.view, stage.T, stage.settings);
    ASSERT_EQ(f.parts, LightParts::direct);
    auto p = std::make_unique<TracedRays>();
    int lit = 0, shaded = 0, background = 0;
    for (int round = 0; round < 1500; ++round) {
        const CameraSamples s = some_samples(1 + random() % kLanes, stage.view, 16, random);
        RgbLanes radiance;
        const std::uint64_t rays_before = p->rays_traced;
        trace(f, s, *p);
        f.integrator.radiance(f.transport, *p, radiance);
        std::uint64_t rays = s.n;
        for (std::size_t i = 0; i < s.n; ++i) {
            const Hit hit = p->hits[i];
            Rgb expected{};
            bool is_lit = false;
            if (hit.body < 0) {
                ++background;
            } else {
                const Vec3 d = p->rays.direction[i];
                const Surface surface = surface_at(stage.render_scene.tracer(), stage.at, hit, d,
                                                   hit.range_m * f.transport.path.pixel_angle_rad);
                expected = surface.emission + stage.scene.ambient * ambient_reflectance(surface);
                const double cosine = dot(surface.normal, p->to_sun[i]);
                const Rgb reflected = bsdf(surface, surface.normal, p->to_sun[i], -d);
                if (cosine > 0 && reflected != Rgb{}) {
                    ++rays;
                    is_lit = !stage.render_scene.tracer().occluded(stage.at, hit, p->to_sun[i],
                                                                   std::numeric_limits<double>::infinity());
                    if (is_lit)
                        expected = expected + reflected * static_cast<float>(f.sun->irradiance() * cosine /
                                                                             dot(p->to_sun[i], f.sun->centre()));
                    ++(is_lit ? lit : shaded);
                }
            }
            ASSERT_EQ(is_set(p->lit, i), is_lit) << i;
            const Rgb got = radiance[i];
            for (int band = 0; band < 3; ++band)
                ASSERT_NEAR(got[band], expected[band], 5e-7f * expected[band])  // a few roundings of a float
                    << "material " << hit.material;
        }
        EXPECT_EQ(p->rays_traced - rays_before, rays);
    }
    EXPECT_GT(lit, 3000);
    EXPECT_GT(shaded, 100);
    EXPECT_GT(background, 1000);
}

TEST(BatchRadiance, TimesOfThePhasesAddUpWhereTheyAreMeasured) {
    std::mt19937_64 random(6);
    const BlockerStage stage(camera(64, 64, 100));
    const Frame f = make_frame(stage.render_scene, stage.at, stage.view, stage.T, stage.settings);
    auto p = std::make_unique<TracedRays>();
    PhaseTimes times{};
    p->times = &times;
    RgbLanes radiance;
    for (int round = 0; round < 300; ++round) {
        trace(f, some_samples(kLanes, stage.view, 16, random), *p);
        f.integrator.radiance(f.transport, *p, radiance);
    }
    for (const Phase phase : {Phase::aim, Phase::rays, Phase::shading, Phase::shadow_rays})
        EXPECT_GT(times[static_cast<std::size_t>(phase)], 0);
    EXPECT_EQ(times[static_cast<std::size_t>(Phase::indirect)], 0);
}

}  // namespace
}  // namespace narpa
