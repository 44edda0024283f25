// Real spacecraft and small bodies, from the file to a frame and a sweep. The meshes are not part of the project.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "emulator/camera/camera_unit.h"
#include "emulator/lidar/lidar_unit.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

struct RealBody {
    const char* name;
    const char* mesh;
    double scale, distance_m, range_max_m;
};
void PrintTo(const RealBody& b, std::ostream* out) {
    *out << b.name;
}

class RealBodies : public ::testing::TestWithParam<RealBody> {};

TEST_P(RealBodies, AreSeenByCameraAndLidar) {
    const RealBody& b = GetParam();
    const std::string mesh = test::source_path("../shared/assets/") + b.mesh;
    if (!std::filesystem::exists(mesh)) GTEST_SKIP() << "no " << b.mesh << " beside the project";
    const test::TemporaryFolder folder;
    std::ofstream(folder / "scene.toml") << fmt::format(
        "[sun]\ndirection = [0.3, -0.8, 0.6]\n[[body]]\nname = \"target\"\nmesh = \"{}\"\nscale = {}\n"
        "[[camera]]\nname = \"nav\"\nposition_m = [0, {}, 0]\nlook_at = [0, 0, 0]\nresolution = [320, 240]\n"
        "fov_horizontal_deg = 60\nrate_hz = 10\n"
        "[[lidar]]\nname = \"top\"\nposition_m = [0, {}, 0]\nmodel = \"VLP-16\"\nrate_hz = 10\nrange_max_m = {}\n",
        mesh, b.scale, -b.distance_m, -std::min(b.distance_m, 0.8 * b.range_max_m), b.range_max_m);
    auto scene = read_scene(folder / "scene.toml");
    ASSERT_TRUE(scene) << scene.error().text();
    auto world = World::create(*std::move(scene));
    ASSERT_TRUE(world) << world.error().text();
    const double reach_m = (*world)->tracer().bounding_radius_m(0);

    CameraUnit camera(**world, 0);
    Aovs aovs;
    camera.expose(0, 0, 0, &aovs);
    std::size_t covered = 0, lit = 0;
    for (std::size_t i = 0; i < aovs.body.size(); ++i) {
        if (aovs.body[i] < 0) continue;
        ++covered;
        lit += camera.radiance().pixels[i].y > 0;
        EXPECT_LE(norm(aovs.position[i]), reach_m * (1 + 1e-6));
    }
    EXPECT_GT(covered, aovs.body.size() / 50);
    EXPECT_LT(covered, aovs.body.size());
    EXPECT_GT(lit, covered / 10);
    EXPECT_LT(lit, covered);  // something lies in shadow

    LidarUnit lidar(**world, 0, true);
    std::size_t returns = 0;
    for (std::int64_t p = 0; p < 76; ++p) {
        lidar.fire(p);
        returns += lidar.returns();
        for (std::size_t i = 0; i < lidar.shots().size(); ++i) {
            if (lidar.truth()[i].range_m <= 0) continue;
            const Vec3 at = (*world)->scene().lidars[0].T_mount_lidar *
                            (lidar.shots()[i].origin_m + lidar.truth()[i].range_m * lidar.shots()[i].direction);
            ASSERT_LE(norm(at), reach_m * (1 + 1e-6));
        }
    }
    EXPECT_GT(returns, 100U);
    RecordProperty("triangles", static_cast<int>((*world)->tracer().triangle_count()));
    RecordProperty("returns", static_cast<int>(returns));
}

INSTANTIATE_TEST_SUITE_P(
    All, RealBodies,
    ::testing::Values(RealBody{"ISS", "spacecraft/iss/iss.obj", 1, 90, 100},
                      RealBody{"Hubble", "spacecraft/hubble/hubble.obj", 1, 20, 100},
                      RealBody{"Bennu", "smallbody/bennu/g_12570mm_alt_obj_0000n00000_v014.obj", 100, 60, 100},
                      RealBody{"Itokawa", "smallbody/itokawa/ItokawaHayabusa.obj", 100, 60, 100},
                      RealBody{"Phobos", "smallbody/phobos/m1phobos.obj", 2, 60, 100}),
    [](const auto& body) { return std::string(body.param.name); });

}  // namespace
}  // namespace narpa
