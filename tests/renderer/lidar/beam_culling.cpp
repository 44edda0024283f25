// Beams of a LiDAR and the boxes about bodies: none that meets a body is left out, most of the others are.
#include "renderer/lidar/beam_culling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "renderer/lidar/beam_cone.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

constexpr double kDivergence_rad = 3e-3, kEnd_m = 11;
constexpr int kSubRays = 64;

/// A rough mesh, a frame of four bars, a mesh far from its own origin, an ellipsoid without boxes.
Scene bodies_about_a_lidar() {
    Scene s;
    s.materials.resize(1);
    add_mesh(s, bumpy(4, 1, 0.3), {{}, {-4, 0, 0}});
    Mesh frame = box(4, 0.1, 0.1);
    for (const Vec3f& by : {Vec3f{0, 4, 0}, Vec3f{0, 2, 2}, Vec3f{0, 2, -2}}) {
        const Mesh bar = box(4, 0.1, 0.1);
        const auto first = static_cast<std::uint32_t>(frame.positions.size());
        for (const Vec3f& p : bar.positions) frame.positions.push_back(p + by);
        for (const auto& f : bar.faces) frame.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
        frame.face_material.insert(frame.face_material.end(), bar.face_material.begin(), bar.face_material.end());
    }
    frame.normals.clear(), frame.uvs.clear();
    add_mesh(s, frame, {{}, {0, -2, 0}});
    Mesh far = box(1, 2, 3);
    for (Vec3f& p : far.positions) p += Vec3f{300, 0, 0};
    add_mesh(s, far, {{}, {-294, 0, 0}});
    add_sphere(s, 1.5, {0, 6, 0});
    s.bodies.back().shape = exact_ellipsoid({1, 2, 1});
    return s;
}

struct Counts {
    std::size_t meet = 0, may_meet = 0, pairs = 0;  ///< of beams and bodies
};

/// Random beams from within the scene, bodies in motion. `offset`: of all of it.
Counts cull(const Vec3& offset) {
    const Scene s = bodies_about_a_lidar();
    const auto tracer = Tracer::create(s, 1);
    EXPECT_TRUE(tracer);
    const BeamCone cone(kDivergence_rad, kSubRays);
    BeamCulling culling(*tracer, cone.tangent(), kEnd_m);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> uniform(0, 1);
    BodyPoses at(s.bodies.size());
    Counts counts;
    for (int round = 0; round < 200; ++round) {
        for (std::size_t b = 0; b < s.bodies.size(); ++b) {
            const Rigid3 T{s.bodies[b].initial.T_world_body.q, s.bodies[b].initial.T_world_body.t + offset};
            at.set(b, T,
                   {T.q * exp_rotation(1e-3 * random_direction(random)), T.t + 0.02 * random_direction(random)});
        }
        RayBatch beams;
        for (; beams.n < 13; ++beams.n)
            beams.put(beams.n,
                      {offset + 0.3 * random_direction(random), random_direction(random), uniform(random)});
        const std::uint32_t any = culling.find_meeting(at, beams);
        for (std::size_t i = 0; i < beams.n; ++i) {
            const auto listed = culling.bodies_of(1u << i);
            EXPECT_EQ(is_set(any, i), !listed.empty());
            const std::vector<std::uint32_t> may(listed.begin(), listed.end());
            const auto across = BeamCone::across(beams.direction[i], static_cast<std::uint32_t>(random()));
            for (std::uint32_t b = 0; b < s.bodies.size(); ++b) {
                bool meets = false;
                for (std::size_t n = 0; n < kSubRays; n += kLanes) {
                    RayBatch rays;
                    HitBatch hits;
                    cone.append(beams[i], across, n, kLanes, rays);
                    tracer->intersect(at, rays, std::span(&b, 1), hits);
                    for_each_lane(hits.met, [&](std::size_t k) { meets |= hits.range_m[k] < kEnd_m; });
                }
                const bool may_meet = std::ranges::find(may, b) != may.end();
                EXPECT_TRUE(may_meet || !meets) << "beam " << i << " of round " << round << ", body " << b;
                counts.meet += meets, counts.may_meet += may_meet, ++counts.pairs;
            }
        }
    }
    return counts;
}

TEST(BeamCulling, LeavesOutNoBeamThatMeetsABody) {
    const Counts near = cull({});
    EXPECT_GT(near.meet, 150u);
    // The frame is all about the LiDAR, and no more than one in a hundred of the beams that miss it pass.
    EXPECT_LT(near.may_meet, near.meet + near.pairs / 100);
    // Far from the world's origin the same differences matter.
    const Counts far = cull({6.8e6, -1e6, 3e5});
    EXPECT_EQ(far.meet, near.meet);
    EXPECT_LT(far.may_meet, near.meet + near.pairs / 100);
}

TEST(BeamCulling, WhatIsBeyondTheRangeIsLeftOut) {
    Scene s;
    s.materials.resize(1);
    add_mesh(s, plate(100, 100), {exp_rotation({0, std::numbers::pi, 0}), {0, 0, 50}});
    add_sphere(s, 1e5, {0, 0, 1e5 + 50});
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    RayBatch beams;
    beams.n = 1;
    beams.put(0, {{}, {0, 0, 1}});
    // Boxes are as much larger as a beam is wide.
    BeamCulling near(*tracer, 1.5e-3, 49.7), far(*tracer, 1.5e-3, 50.1);
    EXPECT_EQ(near.find_meeting(at, beams), 0u);
    EXPECT_TRUE(is_set(far.find_meeting(at, beams), 0));
    EXPECT_EQ(far.bodies_of(1).size(), 2u);
}

}  // namespace
}  // namespace narpa
