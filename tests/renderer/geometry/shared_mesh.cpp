// Bodies that share a mesh: what they store, and how they look.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <random>

#include "base/constants.h"
#include "renderer/geometry/mesh_shape.h"
#include "renderer/geometry/tracer.h"
#include "renderer/scene/own_mesh.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

/// Bodies of one mesh in two materials.
Scene of_one_mesh(int bodies) {
    Scene scene;
    scene.materials = {test::lambert(0.2f), test::lambert(0.5f), test::lambert(0.7f)};
    scene.meshes = {test::bumpy(3, 1, 0.3)};
    for (int i = 0; i < bodies; ++i) {
        Body b;
        b.name = std::to_string(i);
        b.shape = 0;
        b.initial.T_world_body.t = {3.0 * i, 0, 0};
        if (i > 0) b.mesh_material = 1 + i % 2;
        scene.bodies.push_back(std::move(b));
    }
    return scene;
}

TEST(SharedMesh, HasTheMaterialOfEachBody) {
    const Scene scene = of_one_mesh(4);
    const auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer) << tracer.error().text();
    const BodyPoses at = test::placed(scene);
    for (int body = 0; body < 4; ++body) {
        const Hit hit = tracer->intersect(at, {{3.0 * body, 0, 9}, {0, 0, -1}}, kInfinity);
        ASSERT_EQ(hit.body, body);
        EXPECT_EQ(hit.material, body == 0 ? 0 : 1 + body % 2);
    }
    EXPECT_EQ(&tracer->shape(1), &tracer->shape(3)) << "the same mesh in the same material";
    for (std::size_t body = 1; body < 4; ++body)
        EXPECT_EQ(tracer->shape(body).boxes().data(), tracer->shape(0).boxes().data());
}

TEST(SharedMesh, EmitsInTheMaterialsOfItsBodies) {
    Scene scene = of_one_mesh(3);
    scene.materials[1].emission = {3, 3, 3};
    const auto tracer = Tracer::create(scene, 1);
    ASSERT_TRUE(tracer);
    EXPECT_EQ(tracer->shape(0).emission(scene), nullptr);
    ASSERT_NE(tracer->shape(2).emission(scene), nullptr);
    double area_m2 = 0;
    const Mesh& m = scene.meshes[0];
    for (const auto& f : m.faces)
        area_m2 += 0.5 * norm(cross(vec_cast<double>(m.positions[f[1]] - m.positions[f[0]]),
                                    vec_cast<double>(m.positions[f[2]] - m.positions[f[0]])));
    EXPECT_NEAR(tracer->shape(2).emission(scene)->properties().power, 3 * area_m2, 1e-4 * area_m2);
}

std::size_t heap_bytes() {
    const auto info = mallinfo2();
    return info.uordblks + info.hblkhd;
}

TEST(SharedMesh, ABodyStoresLessThanTwoKilobytes) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer brings its own heap";
    const auto bytes_of = [](int bodies) {
        const std::size_t before = heap_bytes();
        const Scene scene = of_one_mesh(bodies);
        const auto tracer = Tracer::create(scene, 1);
        EXPECT_TRUE(tracer);
        BodyPoses at(scene.bodies.size());
        tracer->arrange(at);
        return heap_bytes() - before;
    };
    (void)bytes_of(10);  // what the first tracer of a process stores
    const std::size_t few = bytes_of(1000), many = bytes_of(3000);
    const double each = static_cast<double>(many - few) / 2000;
    RecordProperty("bytes_of_a_body", std::to_string(each));
    EXPECT_LT(each, 2000);
    EXPECT_GT(each, static_cast<double>(sizeof(Body)));
}

TEST(SharedMesh, IsCopiedForTheBodyThatChangesIt) {
    Scene scene = of_one_mesh(3);
    Mesh* const own = own_mesh(scene, 1);
    ASSERT_NE(own, nullptr);
    own->positions[0].x = 99;
    EXPECT_EQ(scene.meshes.size(), 2u);
    EXPECT_EQ(std::get<int>(scene.bodies[1].shape), 1);
    EXPECT_EQ(std::get<int>(scene.bodies[2].shape), 0);
    EXPECT_NE(scene.meshes[0].positions[0].x, 99);
    EXPECT_EQ(own_mesh(scene, 1), &scene.meshes[1]) << "it is alone by now";
    scene.bodies[0].shape = exact_sphere(1);
    EXPECT_EQ(own_mesh(scene, 0), nullptr);
}

TEST(BoxTree, HasTheSizeOfTheMesh) {
    EXPECT_LE(box_tree(test::box(1, 1, 1)).size(), 63u);
    EXPECT_LE(box_tree(test::icosphere(2, 1, false)).size(), 4u * 320);
    EXPECT_LE(box_tree(test::icosphere(5, 1, false)).size(), 2 * kBoxLeaves - 1);
    EXPECT_GT(box_tree(test::icosphere(5, 1, false)).size(), kBoxLeaves);
}

}  // namespace
}  // namespace narpa
