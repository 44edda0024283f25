// The debris scene: 10,000 bodies that share four meshes and move as a file says.
#include <gtest/gtest.h>

#include <filesystem>

#include "emulator/world.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

TEST(Debris, IsManyBodiesOfFewMeshes) {
    const std::string path = test::build_path("scenes/debris/debris.toml");
    EXPECT_LT(std::filesystem::file_size(test::build_path("scenes/debris/debris.csv")), 2'000'000u);
    auto scene = read_scene(path);
    ASSERT_TRUE(scene) << scene.error().text();
    ASSERT_EQ(scene->bodies.size(), 10'001u);
    EXPECT_EQ(scene->meshes.size(), 4u);
    std::size_t commanded = 0;
    for (const Body& b : scene->bodies) commanded += b.can_id ? 1 : 0;
    EXPECT_EQ(commanded, 1u) << "the inspector";

    auto world = World::create(*std::move(scene));
    ASSERT_TRUE(world) << world.error().text();
    BodyPoses at((*world)->scene().bodies.size());
    (*world)->place(0, 0, at);
    const Vec3 before = at.T_world_body[77].t;
    ASSERT_NE((*world)->tracer().tree(at), nullptr);
    (*world)->place(2'000'000'000, 0, at);
    ASSERT_NE((*world)->tracer().tree(at), nullptr);
    const Vec3 moved = at.T_world_body[77].t - before;
    EXPECT_GT(norm(moved), 1e-3);
    EXPECT_LT(norm(moved), 1);
    (*world)->place_moving(2'000'000'000, 2'100'000'000, at);
    EXPECT_TRUE(at.moves(77));
    ASSERT_NE((*world)->tracer().tree(at), nullptr);
}

}  // namespace
}  // namespace narpa
