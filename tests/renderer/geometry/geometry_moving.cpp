// Bodies that move within an exposure: each ray meets them at its own moment.
#include <gtest/gtest.h>

#include <random>

#include "renderer/geometry/tracer.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// A smooth mesh, a faceted one, a ball and an ellipsoid about the origin; the last of them stands still.
Scene four_bodies() {
    Scene s;
    s.materials.resize(1);
    add_mesh(s, icosphere(3, 1.0, true), {{}, {-3, 0, 0}});
    add_mesh(s, box(1, 2, 3), {{}, {3, 0, 0}});
    add_sphere(s, 1, {0, 3, 0});
    add_sphere(s, 1.5, {0, -3, 0});
    s.bodies.back().shape = exact_ellipsoid({1, 2, 1});
    return s;
}

Rigid3 moved(const Rigid3& T, std::mt19937_64& random) {
    return {T.q * exp_rotation(0.3 * random_direction(random)), T.t + 0.5 * random_direction(random)};
}

TEST(MovingBodies, EachRayMeetsThemAtItsOwnMoment) {
    const Scene s = four_bodies();
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer) << tracer.error().text();
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    BodyPoses moving(4);
    std::size_t seen = 0, dark = 0, again = 0;
    for (int round = 0; round < 100; ++round) {
        for (std::size_t b = 0; b < 4; ++b) {
            const Rigid3 T = s.bodies[b].initial.T_world_body;
            if (b == 3)
                moving.set(b, T);
            else
                moving.set(b, T, moved(T, random));
        }
        ASSERT_TRUE(moving.moving());
        RayBatch rays;
        Vec3Lanes to_sun;
        to_sun.fill(normalized(Vec3{1, 1, 0.2}));
        Vec3Lanes away;
        for (rays.n = 0; rays.n < kLanes; ++rays.n) {
            const Vec3 eye = 12.0 * random_direction(random);
            rays.put(rays.n, {eye, normalized(3.0 * random_direction(random) - eye), uniform(random)});
        }
        HitBatch hits, next;
        tracer->intersect(moving, rays, tracer->all_bodies(), hits);
        for_each_lane(hits.met, [&](std::size_t i) {
            away.put(i, normalized(hits.geometric_normal[i] + 0.7 * random_direction(random)));
        });
        const std::uint32_t shadows = tracer->occluded(moving, hits, to_sun, hits.met);
        tracer->intersect(moving, hits, away, hits.met, next);
        for (std::size_t i = 0; i < kLanes; ++i) {
            BodyPoses still(4);
            for (std::size_t b = 0; b < 4; ++b) still.set(b, moving.T_world_body_at(b, rays.time[i]));
            HitBatch one, one_next;
            tracer->intersect(still, rays, tracer->all_bodies(), one);
            ASSERT_EQ(hits.body[i], one.body[i]);
            if (one.body[i] < 0) continue;
            ++seen;
            EXPECT_EQ(hits.range_m[i], one.range_m[i]);
            EXPECT_EQ(hits.position[i], one.position[i]);
            EXPECT_EQ(hits.shading_normal[i], one.shading_normal[i]);
            EXPECT_EQ(hits.time[i], rays.time[i]);
            const std::uint32_t lane = 1u << i;
            EXPECT_EQ(shadows & lane, tracer->occluded(still, one, to_sun, lane));
            dark += (shadows & lane) != 0;
            tracer->intersect(still, one, away, lane, one_next);
            ASSERT_EQ(next.body[i], one_next.body[i]);
            if (one_next.body[i] < 0) continue;
            ++again;
            EXPECT_EQ(next.range_m[i], one_next.range_m[i]);
            EXPECT_EQ(next.position[i], one_next.position[i]);
        }
    }
    EXPECT_GT(seen, 300u);
    EXPECT_GT(dark, 20u);
    EXPECT_GT(again, 20u);
}

TEST(MovingBodies, PathsBeginAndEndAtTheirPosesAndTurnEvenly) {
    std::mt19937_64 random(8);
    const Rigid3 start{random_attitude(random), {1e6, 2, 3}}, end = moved(start, random);
    BodyPoses at(1);
    at.set(0, start, end);
    EXPECT_TRUE(at.moves(0));
    EXPECT_EQ(at.T_world_body_at(0, 0), start);
    EXPECT_EQ(at.T_world_body_at(0, 1), end);
    EXPECT_EQ(at.T_world_body[0], at.T_world_body_at(0, 0.5));
    const Rigid3 T = at.T_world_body_at(0, 0.25);
    EXPECT_NEAR(angle_between(start.q, T.q), 0.25 * angle_between(start.q, end.q), 1e-12);
    EXPECT_NEAR(norm(T.t - (0.75 * start.t + 0.25 * end.t)), 0, 1e-9);
    at.set(0, start);
    EXPECT_FALSE(at.moving());
    EXPECT_EQ(at.T_world_body_at(0, 0.7), start);
    at.set(0, end, end);
    EXPECT_FALSE(at.moving());
    EXPECT_EQ(at.T_world_body[0], end);
}

}  // namespace
}  // namespace narpa
