// Rays among many bodies: what the tree over them finds, and what it costs.
#include "renderer/geometry/body_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>

#include "base/constants.h"
#include "renderer/geometry/sphere_roots.h"
#include "renderer/geometry/tracer.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using test::random_direction;

/// Boxes that share a mesh, in two materials, spheres, smooth meshes, and a planet.
Scene swarm(std::mt19937_64& rng, int bodies) {
    std::normal_distribution<double> n(0, 1);
    Scene scene;
    scene.materials = {test::lambert(0.5f), test::lambert(0.7f)};
    scene.meshes = {test::box(0.6, 0.4, 0.5), test::icosphere(2, 0.5, true)};
    for (int i = 0; i < bodies; ++i) {
        Body b;
        b.name = std::to_string(i);
        if (i % 3 == 2)
            b.shape = exact_sphere(0.4);
        else
            b.shape = i % 3;
        if (i % 6 == 0) b.mesh_material = 1;
        b.initial.T_world_body = {test::random_attitude(rng), 8.0 * Vec3{n(rng), n(rng), n(rng)}};
        scene.bodies.push_back(b);
    }
    test::add_sphere(scene, 6.4e6, {0, 0, -6.4e6 - 30});
    return scene;
}

/// Where the bodies are; every second one moves within the exposure.
BodyPoses poses_of(const Scene& scene, const Vec3& offset, bool moving, std::mt19937_64& rng) {
    BodyPoses at = test::placed(scene, offset);
    for (std::size_t i = 0; moving && i < scene.bodies.size(); i += 2) {
        const Rigid3 start = at.T_world_body[i];
        at.set(i, start, {start.q * exp_rotation(0.3 * random_direction(rng)), start.t + random_direction(rng)});
    }
    return at;
}

struct Batch {
    RayBatch rays;
    Vec3Lanes onward;
};
Batch random_batch(const Vec3& offset, std::mt19937_64& rng) {
    std::normal_distribution<double> n(0, 1);
    Batch b;
    const Vec3 eye = offset + 20.0 * Vec3{n(rng), n(rng), n(rng)};
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 target = offset + 8.0 * Vec3{n(rng), n(rng), n(rng)};
        b.rays.put(b.rays.n++, {eye, normalized(target - eye), static_cast<double>(i) / 15});
        b.onward.put(i, random_direction(rng));
    }
    return b;
}

void expect_same(const HitBatch& a, const HitBatch& b) {
    ASSERT_EQ(a.met, b.met);
    for_each_lane(a.met, [&](std::size_t i) {
        ASSERT_EQ(a.body[i], b.body[i]);
        ASSERT_EQ(a.face[i], b.face[i]);
        ASSERT_EQ(a.range_m[i], b.range_m[i]);
        ASSERT_EQ(a.material[i], b.material[i]);
        ASSERT_EQ(a.position[i], b.position[i]);
    });
}

TEST(BodyTree, RaysFindWhatTheyFindWithoutIt) {
    std::mt19937_64 rng(31);
    int met = 0, onward = 0, dark = 0;
    for (const Vec3& offset : {Vec3{}, Vec3{3e8, -1.5e11, 7e6}})
        for (const bool moving : {false, true}) {
            const Scene scene = swarm(rng, 300);
            const auto tracer = Tracer::create(scene, 1);
            ASSERT_TRUE(tracer) << tracer.error().text();
            const BodyPoses one_by_one = poses_of(scene, offset, moving, rng);
            BodyPoses at = one_by_one;
            tracer->arrange(at);
            ASSERT_NE(tracer->tree(at), nullptr);
            ASSERT_EQ(tracer->tree(one_by_one), nullptr);
            for (int k = 0; k < 400; ++k) {
                const Batch b = random_batch(offset, rng);
                HitBatch hits, expected, next, expected_next;
                tracer->intersect(at, b.rays, tracer->all_bodies(), hits);
                tracer->intersect(one_by_one, b.rays, tracer->all_bodies(), expected);
                expect_same(hits, expected);
                tracer->intersect(at, hits, b.onward, hits.met, next);
                tracer->intersect(one_by_one, hits, b.onward, hits.met, expected_next);
                expect_same(next, expected_next);
                const std::uint32_t shadow = tracer->occluded(at, hits, b.onward, hits.met);
                ASSERT_EQ(shadow, tracer->occluded(one_by_one, hits, b.onward, hits.met));
                const Hit without = tracer->intersect(at, b.rays[0], kInfinity, hits.body[0]);
                ASSERT_EQ(without.body, tracer->intersect(one_by_one, b.rays[0], kInfinity, hits.body[0]).body);
                met += std::popcount(hits.met), onward += std::popcount(next.met), dark += std::popcount(shadow);
            }
        }
    EXPECT_GT(met, 10'000);
    EXPECT_GT(onward, 2'000);
    EXPECT_GT(dark, 2'000);
}

TEST(BodyTree, HoldsForOneSetOfPosesAndOneTracer) {
    std::mt19937_64 rng(32);
    const Scene scene = swarm(rng, 100);
    const auto tracer = Tracer::create(scene, 1), other = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer && other);
    BodyPoses at = test::placed(scene);
    {
        const test::AllocationCounter counter;
        tracer->arrange(at);
        EXPECT_EQ(counter.on_this_thread(), 0u);
    }
    EXPECT_NE(tracer->tree(at), nullptr);
    EXPECT_EQ(other->tree(at), nullptr);
    at.set(3, {{1, 0, 0, 0}, {100, 0, 0}});
    EXPECT_EQ(tracer->tree(at), nullptr);
    const Scene few = swarm(rng, static_cast<int>(BodyTree::kFewBodies) - 1);
    const auto of_few = Tracer::create(few, 1);
    ASSERT_TRUE(of_few);
    BodyPoses of_few_at = test::placed(few);
    of_few->arrange(of_few_at);
    EXPECT_EQ(of_few->tree(of_few_at), nullptr);
    EXPECT_TRUE(of_few_at.tree().nodes().empty());
}

struct RayCost {
    double nodes = 0, bodies = 0;  ///< tested, in the mean
};
/// Of single rays through a ball of this many spheres, which cover the same part of its cross-section.
RayCost mean_cost(std::size_t bodies, std::mt19937_64& rng) {
    const double radius_m = 0.3 / std::sqrt(static_cast<double>(bodies));
    BodyTree tree(bodies);
    for (BodyTree::Sphere& s : tree.spheres())
        s = {std::cbrt(std::uniform_real_distribution<double>()(rng)) * random_direction(rng), radius_m};
    tree.build(&tree);
    constexpr int kRays = 2000;
    RayCost cost;
    for (int k = 0; k < kRays; ++k) {
        const Vec3 eye = 3.0 * random_direction(rng), d = normalized(0.7 * random_direction(rng) - eye);
        tree.visit(
            1u,
            [&](const BodyTree::Node& node, std::uint32_t) {
                cost.nodes += 1.0 / kRays;
                return bounding_entry(eye - node.bounds.centre, d, node.bounds.radius_m) < kInfinity ? 1u : 0u;
            },
            [&](std::uint32_t, std::uint32_t) {
                cost.bodies += 1.0 / kRays;
                return 0u;
            });
    }
    return cost;
}

// A ray that passes between bodies in a volume passes the cells of N^(1/3) of them.
TEST(BodyTree, RaysTestACubeRootOfTheBodiesAtMost) {
    std::mt19937_64 rng(33);
    double before = 0;
    for (const std::size_t bodies : {100u, 1000u, 10'000u, 100'000u}) {
        const RayCost cost = mean_cost(bodies, rng);
        RecordProperty("nodes_of_" + std::to_string(bodies), std::to_string(cost.nodes));
        EXPECT_LT(cost.bodies, 0.5) << bodies;
        EXPECT_LT(cost.nodes, 13 * std::cbrt(static_cast<double>(bodies))) << bodies;
        if (before > 0) {
            EXPECT_LT(cost.nodes, 2.6 * before) << "ten times the bodies, " << bodies;
        }
        before = cost.nodes;
    }
}

TEST(BodyTree, NodesHoldTheirBodiesAtAnyTime) {
    std::mt19937_64 rng(34);
    const Scene scene = swarm(rng, 200);
    const auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    BodyPoses at = poses_of(scene, {1e7, 0, 0}, true, rng);
    tracer->arrange(at);
    const auto nodes = tracer->tree(at)->nodes();
    ASSERT_EQ(nodes.size(), 2 * scene.bodies.size() - 1);
    std::size_t leaves = 0;
    const auto check = [&](const auto& self, std::uint32_t index, std::vector<std::uint32_t> above) -> void {
        above.push_back(index);
        if (nodes[index].children != 0) {
            self(self, nodes[index].children, above);
            return self(self, nodes[index].children + 1, above);
        }
        ++leaves;
        const std::uint32_t body = nodes[index].body;
        for (const std::uint32_t node : above)
            for (const double time : {0.0, 0.3, 1.0})
                EXPECT_LE(
                    norm(at.position_at(body, time) - nodes[node].bounds.centre) + tracer->bounding_radius_m(body),
                    nodes[node].bounds.radius_m * (1 + 1e-12));
        EXPECT_LE(above.size(), 2 + std::bit_width(scene.bodies.size()));
    };
    check(check, 0, {});
    EXPECT_EQ(leaves, scene.bodies.size());
}

}  // namespace
}  // namespace narpa
