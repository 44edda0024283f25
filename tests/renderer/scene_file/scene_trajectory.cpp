// Bodies that move as a trajectory file says.
#include <gtest/gtest.h>

#include <cmath>

#include "base/constants.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/trajectory/trajectory.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

const std::string kRest =
    "[ambient]\nradiance = 1\n[[camera]]\nname = \"c\"\nresolution = [8, 8]\nfov_diagonal_deg = 9\n";

class TrajectoryBodies : public ::testing::Test {
protected:
    TrajectoryBodies() {
        folder_.write("t.csv", std::string(kTrajectoryHeader) +
                                   "\n0,a-1,1,0,0,1,0,0,0,1,0,0,0,0,0\n"
                                   "1,alone,0,0,0,1,0,0,0,0,0,2,0,0,0.5\n"
                                   "10,a-1,21,0,0,1,0,0,0,3,0,0,0,0,0\n"
                                   "0,a-2,5,6,7,1,0,0,0,0,0,0,0,0,0\n");
        folder_.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    }
    Result<Scene> read(const std::string& bodies) { return read_scene(folder_.write("s.toml", bodies + kRest)); }
    test::MemoryFolder folder_;
};

const char* const kFlown = "trajectory = \"t.csv\"\n";
const char* const kBall = "sphere = {radius_m = 1}\n";

TEST_F(TrajectoryBodies, OneMovesAsItsRowsSay) {
    const auto s = read(std::string("[[body]]\nname = \"alone\"\n") + kBall + kFlown +
                        "[[body]]\nname = \"a-1\"\n" + kBall + kFlown);
    ASSERT_TRUE(s) << s.error().text();
    ASSERT_EQ(s->bodies.size(), 2u);
    const Body &alone = s->bodies[0], &one = s->bodies[1];
    EXPECT_FALSE(alone.can_id);
    // Constant velocity and rate before the first row and after the last.
    EXPECT_NEAR(alone.initial.T_world_body.t.z, -2, 1e-12);
    EXPECT_NEAR(motion_at(alone, 3).T_world_body.t.z, 4, 1e-12);
    EXPECT_NEAR(angle_between(motion_at(alone, 3).T_world_body.q, {}), 1, 1e-9);
    // Between rows a cubic through both velocities.
    EXPECT_EQ(motion_at(one, 0).T_world_body.t.x, 1);
    EXPECT_EQ(motion_at(one, 10).T_world_body.t.x, 21);
    EXPECT_NEAR(motion_at(one, 5).T_world_body.t.x, 11 + 10.0 / 8 * (1 - 3), 1e-12);
    const double slope = (motion_at(one, 2.001).T_world_body.t.x - motion_at(one, 1.999).T_world_body.t.x) / 0.002;
    EXPECT_NEAR(motion_at(one, 2).velocity_m_s.x, slope, 1e-6);
}

TEST_F(TrajectoryBodies, AStarStandsForAllThatBeginSo) {
    const auto s = read(std::string("[[body]]\nname = \"a-*\"\nmesh = \"t.obj\"\n") + kFlown +
                        "material = {kind = \"lambert\", albedo = 0.3}\n[[body]]\nname = \"still\"\n" + kBall);
    ASSERT_TRUE(s) << s.error().text();
    ASSERT_EQ(s->bodies.size(), 3u);
    EXPECT_EQ(s->bodies[0].name, "a-1");
    EXPECT_EQ(s->bodies[1].name, "a-2");
    EXPECT_EQ(s->bodies[2].name, "still");
    EXPECT_EQ(s->meshes.size(), 1u);
    EXPECT_EQ(s->bodies[1].mesh_material, 0);
    EXPECT_EQ(std::get<int>(s->bodies[1].shape), 0);
    EXPECT_EQ(s->bodies[1].initial.T_world_body.t, (Vec3{5, 6, 7}));
}

TEST_F(TrajectoryBodies, MistakesNameTheirPlace) {
    const auto expect = [&](const std::string& keys, int line, const std::string& words) {
        const auto s = read("[[body]]\n" + keys + kBall);
        ASSERT_FALSE(s) << keys;
        EXPECT_EQ(s.error().line, line) << s.error().text();
        EXPECT_NE(s.error().text().find(words), std::string::npos) << s.error().text();
    };
    const std::string flown = kFlown;
    expect("name = \"b\"\n" + flown, 3, "has no body \"b\", expected rows of this name");
    expect("name = \"b-*\"\n" + flown, 3, "has no body whose name begins with \"b-\"");
    expect("name = \"a-1\"\nposition_m = [0, 0, 0]\n" + flown, 3, "follows from trajectory");
    expect("name = \"a-1\"\ncan_id = 0x100\n" + flown, 3, "follows from trajectory");
    expect("name = \"a-*\"\n", 2, "expected 1 to 64 letters");
    expect("name = \"a-1\"\ntrajectory = \"none.csv\"\n", 3, "none.csv");
    expect("name = \"a-1\"\n" + flown + kBall + "[[body]]\nname = \"a-*\"\n" + flown, 6, "the name of another");
    folder_.write("t.csv", std::string(kTrajectoryHeader) + "\n0,a-1,1,0,0,1,0,0,0,1,0,0,0,0,x\n");
    expect("name = \"a-1\"\n" + flown, 2, "\"x\" where a finite number was expected");
}

}  // namespace
}  // namespace narpa
