// The embedded docking scene: what its generator writes, and the approach beside it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "base/pose.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"

namespace narpa {
namespace {

namespace fs = std::filesystem;

const fs::path kDockingScene = std::filesystem::path(test::build_path("scenes/docking"));

/// An OBJ file as written, faces cut into triangles: corners by number of position, so that what meets in space
/// meets here.
struct ObjMesh {
    std::vector<Vec3> positions;
    std::vector<std::array<int, 3>> faces;
    std::vector<std::string> face_part;
    std::set<std::string> materials;
};
ObjMesh read_obj(const fs::path& path) {
    ObjMesh mesh;
    std::ifstream file(path);
    std::string line, key, part;
    while (std::getline(file, line)) {
        std::istringstream in(line);
        in >> key;
        if (key == "v") {
            Vec3 p;
            in >> p.x >> p.y >> p.z;
            mesh.positions.push_back(p);
        } else if (key == "o") {
            in >> part;
        } else if (key == "usemtl") {
            in >> key;
            mesh.materials.insert(key);
        } else if (key == "f") {
            std::vector<int> corners;
            for (std::string corner; in >> corner;) {
                const int number = std::atoi(corner.c_str());  // from 1, or back from the newest as -1
                corners.push_back(number < 0 ? static_cast<int>(mesh.positions.size()) + number : number - 1);
            }
            for (std::size_t i = 2; i < corners.size(); ++i) {
                mesh.faces.push_back({corners[0], corners[i - 1], corners[i]});
                mesh.face_part.push_back(part);
            }
        }
    }
    return mesh;
}
std::array<Vec3, 3> corners(const ObjMesh& m, std::size_t f) {
    const auto at = [&](std::size_t i) { return m.positions[static_cast<std::size_t>(m.faces[f][i])]; };
    return {at(0), at(1), at(2)};
}

/// A shell is what hangs together through shared corners. Returns the shell of every face.
std::vector<std::size_t> shells_of(const ObjMesh& m) {
    std::vector<std::size_t> parent(m.positions.size());
    std::iota(parent.begin(), parent.end(), std::size_t{0});
    const auto root = [&](std::size_t i) {
        while (parent[i] != i) i = parent[i] = parent[parent[i]];
        return i;
    };
    for (const auto& f : m.faces)
        for (const int v : f) parent[root(static_cast<std::size_t>(v))] = root(static_cast<std::size_t>(f[0]));
    std::vector<std::size_t> shell;
    for (const auto& f : m.faces) shell.push_back(root(static_cast<std::size_t>(f[0])));
    return shell;
}

class DockingMesh : public testing::TestWithParam<const char*> {
protected:
    const ObjMesh mesh = read_obj(kDockingScene / (std::string(GetParam()) + ".obj"));
};
INSTANTIATE_TEST_SUITE_P(Bodies, DockingMesh, testing::Values("station", "chaser"),
                         [](const auto& body) { return std::string(body.param); });

TEST_P(DockingMesh, HasNoDegenerateOrRepeatedTriangles) {
    ASSERT_FALSE(mesh.faces.empty()) << kDockingScene;
    std::set<std::array<int, 3>> seen;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto [a, b, c] = corners(mesh, f);
        const double area = 0.5 * norm(cross(b - a, c - a));
        const double longest = std::max({norm(b - a), norm(c - b), norm(a - c)});
        ASSERT_GT(area, 1e-4 * longest * longest) << "face " << f << " of " << mesh.face_part[f];
        auto sorted = mesh.faces[f];
        std::sort(sorted.begin(), sorted.end());
        ASSERT_TRUE(seen.insert(sorted).second) << "face " << f << " of " << mesh.face_part[f];
    }
}

TEST_P(DockingMesh, EveryShellIsClosedAndFacesOutwards) {
    std::map<std::pair<int, int>, int> balance;  // how often each edge is walked, one way less the other
    for (const auto& f : mesh.faces)
        for (std::size_t i = 0; i < 3; ++i) {
            const int a = f[i], b = f[(i + 1) % 3];
            balance[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
        }
    const auto open = std::count_if(balance.begin(), balance.end(), [](const auto& e) { return e.second != 0; });
    EXPECT_EQ(open, 0);

    const std::vector<std::size_t> shell = shells_of(mesh);
    std::map<std::size_t, double> volume_m3;
    std::map<std::size_t, std::string> part;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const Vec3 origin = mesh.positions[shell[f]];
        const auto [a, b, c] = corners(mesh, f);
        volume_m3[shell[f]] += dot(a - origin, cross(b - origin, c - origin)) / 6;
        part[shell[f]] = mesh.face_part[f];
    }
    EXPECT_GT(volume_m3.size(), 20u);
    for (const auto& [id, v] : volume_m3) EXPECT_GT(v, 0) << "a shell of " << part[id];
}

TEST(DockingScene, StationIsLargeVariedAndReachesTheInterfacePlane) {
    const ObjMesh m = read_obj(kDockingScene / "station.obj");
    EXPECT_GE(m.faces.size(), 100'000u);
    EXPECT_LE(m.faces.size(), 200'000u);
    EXPECT_GE(m.materials.size(), 12u);
    Vec3 low = m.positions[0], high = low;
    for (const Vec3& p : m.positions)
        for (int i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    EXPECT_NEAR(high.y - low.y, 28, 3);
    for (const Vec3& p : m.positions) {  // only the guide petals stand before the interface plane, inside the ring
        ASSERT_LE(p.x, 0.21);
        if (p.x > 0) {
            ASSERT_LT(std::hypot(p.y, p.z), 0.60);
        }
    }
}

TEST(DockingScene, ReadsWithoutAWarning) {
    const Result<Scene> scene = read_scene((kDockingScene / "docking.toml").string());
    ASSERT_TRUE(scene.has_value()) << scene.error().text();
    EXPECT_TRUE(scene->warnings.empty()) << scene->warnings[0];
    ASSERT_EQ(scene->bodies.size(), 2u);
    EXPECT_EQ(scene->bodies[1].can_id, 0x100u);
    EXPECT_GE(scene->textures.size(), 5u);
    for (const Mesh& mesh : scene->meshes) EXPECT_EQ(mesh.uvs.size(), mesh.positions.size());
    ASSERT_EQ(scene->cameras.size(), 1u);
    const Vec3 axis = scene->cameras[0].T_mount_camera.q * Vec3{0, 0, 1};
    EXPECT_LT(norm(axis - Vec3{1, 0, 0}), 1e-12);
    ASSERT_EQ(scene->lidars.size(), 1u);
    const Vec3 ahead = scene->lidars[0].T_mount_lidar.q * Vec3{0, 1, 0};
    EXPECT_LT(norm(ahead - Vec3{1, 0, 0}), 1e-12);
}

TEST(DockingScene, GeneratorWritesTheSameBytesAgain) {
    const fs::path again = fs::path(testing::TempDir()) / "narpa_docking_again";
    fs::create_directories(again);
    const std::string program = (std::filesystem::path(test::build_path("bin/make_scene"))).string();
    // Another locale and another folder must change nothing.
    const std::string command = "LC_ALL=de_DE.UTF-8 '" + program + "' docking '" + again.string() + "' >/dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
    int compared = 0;
    for (const auto& entry : fs::directory_iterator(again)) {
        const std::string first = test::read_text(kDockingScene / entry.path().filename());
        EXPECT_FALSE(first.empty()) << entry.path();
        EXPECT_TRUE(first == test::read_text(entry.path())) << entry.path();
        ++compared;
    }
    EXPECT_EQ(compared, 10);
    fs::remove_all(again);
}

}  // namespace
}  // namespace narpa
