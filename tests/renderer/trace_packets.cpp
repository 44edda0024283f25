// Rays that travel together meet what each would meet alone.
#include <gtest/gtest.h>

#include <random>

#include "renderer/trace/tracer.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A smooth and a faceted mesh and two spheres, one far away, turned and moved at random.
Scene crowd(std::mt19937_64& rng) {
    std::normal_distribution<double> n(0, 1);
    Scene scene;
    scene.materials.resize(1);
    scene.sun = Sun{normalized(Vec3{n(rng), n(rng), n(rng)}), 1361, 0};
    scene.meshes.push_back(test::icosphere(3, 1.0, true));
    scene.meshes.push_back(test::icosphere(2, 1.5, false));
    const auto add = [&](decltype(Body::shape) shape, const Vec3& at) {
        Body b;
        b.name = std::to_string(scene.bodies.size());
        b.shape = shape;
        b.initial.T_world_body = {normalized(Quat{n(rng), n(rng), n(rng), n(rng)}), at};
        scene.bodies.push_back(b);
    };
    for (int i = 0; i < 40; ++i) add(i % 2, 6.0 * Vec3{n(rng), n(rng), n(rng)});  // more than one batch of bodies
    add(Sphere{2, 0}, {0, 1, 0});
    add(Sphere{6.4e6, 0}, {0, 0, -6.8e6});
    return scene;
}

TEST(Packets, MeetWhatEachRayMeetsAlone) {
    std::mt19937_64 rng(11);
    std::normal_distribution<double> n(0, 1);
    std::size_t seen = 0, hidden = 0, shadows_differ = 0;
    for (int round = 0; round < 4; ++round) {
        const Scene scene = crowd(rng);
        const auto tracer = Tracer::create(scene, 1);
        ASSERT_TRUE(tracer) << tracer.error().text();
        Placement at(scene.bodies.size());
        for (std::size_t i = 0; i < scene.bodies.size(); ++i) at.set(i, scene.bodies[i].initial.T_world_body);
        for (int k = 0; k < 500; ++k) {
            const Vec3 eye{20 * n(rng), 20 * n(rng), 20 * n(rng)},
                axis = normalized(Vec3{n(rng), n(rng), n(rng)} - eye);
            const std::size_t count = 1 + static_cast<std::size_t>(k) % kPacket;
            std::array<Ray, kPacket> rays;
            for (Ray& r : rays) r = {eye, normalized(axis + 0.02 * Vec3{n(rng), n(rng), n(rng)})};
            std::array<Hit, kPacket> hits;
            tracer->intersect(at, std::span(rays).first(count), hits);
            std::array<Vec3, kPacket> to_sun;
            to_sun.fill(scene.sun->direction);
            std::uint32_t wanted = 0;
            for (std::size_t i = 0; i < count; ++i) {
                const Hit alone = tracer->intersect(at, rays[i], kInfinity);
                ASSERT_EQ(hits[i].body, alone.body);
                if (alone.body < 0) continue;
                ++seen;
                wanted |= 1u << i;
                // On an edge either of two faces may be named: the point is the same to rounding in single
                // precision.
                EXPECT_LE(norm(hits[i].position - alone.position), 1e-5);
                EXPECT_NEAR(hits[i].range_m, alone.range_m, 1e-5);
            }
            const std::uint32_t dark = tracer->occluded(at, std::span(hits).first(count), to_sun, wanted);
            EXPECT_EQ(dark & ~wanted, 0U);
            for (std::size_t i = 0; i < count; ++i) {
                if ((wanted >> i & 1u) == 0) continue;
                const bool alone = tracer->occluded(at, hits[i], to_sun[i], kInfinity);
                hidden += alone;
                shadows_differ += alone != ((dark >> i & 1u) != 0);
            }
        }
    }
    EXPECT_GT(seen, 1000U);
    EXPECT_GT(hidden, 100U);
    EXPECT_LE(shadows_differ, 1U);  // a ray that grazes an edge may go either way
}

TEST(Packets, OfNothingAskNothing) {
    const Scene scene;
    const auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    const Placement nowhere(0);
    tracer->intersect(nowhere, std::span<const Ray>{}, std::span<Hit>{});
    EXPECT_EQ(tracer->occluded(nowhere, std::span<const Hit>{}, std::span<const Vec3>{}, std::uint32_t{0}), 0U);
}

}  // namespace
}  // namespace narpa
