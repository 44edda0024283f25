/// Real meshes, where the folder that holds them is there. Counts are those of the files' own documentation.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>

#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::asset_file;
using test::MemoryFolder;

struct Asset {
    const char* file;
    double scale;
    std::size_t triangles, textures;
    Vec3 size_m;  ///< of the bounds
    double tolerance_m;
};
void PrintTo(const Asset& asset, std::ostream* out) {
    *out << asset.file;
}

const Asset kAssets[] = {
    {"spacecraft/iss/iss.obj", 1, 223989, 15, {111.98, 68.79, 58.63}, 0.02},
    {"spacecraft/hubble/hubble.obj", 1, 19332, 5, {11.07, 16.73, 12.36}, 0.01},
    {"spacecraft/cassini/cassini.obj", 1, 24039, 3, {17.98, 11.66, 13.11}, 0.01},
    {"smallbody/bennu/g_12570mm_alt_obj_0000n00000_v014.obj", 1000, 12288, 0, {562, 541, 499}, 1},
    {"smallbody/itokawa/ItokawaHayabusa.obj", 1000, 49152, 1, {562, 305, 243}, 1},
    {"smallbody/phobos/m1phobos.obj", 1000, 31158, 1, {23400, 26000, 19400}, 100},
    {"smallbody/67p/67P-CG.obj", 1000, 13196, 0, {5010, 3690, 3250}, 10},
    {"testmeshes/spot/spot.obj", 1, 5856, 0, {}, 1e9},
    {"testmeshes/spot/spot_quadrangulated.obj", 1, 5856, 0, {}, 1e9},
    {"testmeshes/common/stanford-bunny.obj", 1, 69451, 0, {0.156, 0.154, 0.121}, 0.001},
    {"spacecraft/astrobee_dock/meshes/dock.dae", 1, 25798, 0, {}, 1e9},
    {"spacecraft/hubble/hubble.glb", 1, 19332, 5, {11.07, 16.73, 12.36}, 0.01},
    {"smallbody/castalia/4769castalia.tab", 1000, 4092, 0, {}, 1e9},
};

class RealMesh : public testing::TestWithParam<Asset> {};

TEST_P(RealMesh, HasTheTrianglesSizeAndTexturesThatItSays) {
    const Asset& asset = GetParam();
    const std::string path = asset_file(asset.file);
    NARPA_SKIP_WITHOUT(path);
    const auto start = std::chrono::steady_clock::now();
    const Result<MeshFile> m = read_mesh(path, asset.scale);
    const auto elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start);
    ASSERT_TRUE(m) << m.error().text();
    RecordProperty("load_s", std::to_string(elapsed.count()));
    std::cout << asset.file << ": " << m->mesh.faces.size() << " triangles in " << elapsed.count() << " s\n";
    EXPECT_EQ(m->mesh.faces.size() + m->degenerate + m->duplicate + m->non_finite, asset.triangles);
    EXPECT_LT(m->degenerate + m->duplicate + m->non_finite, asset.triangles / 100 + 1);
    std::set<std::string> textures;
    for (const MeshMaterial& material : m->materials)
        if (material.colour.named()) textures.insert(material.colour.file);
    EXPECT_EQ(textures.size(), asset.textures);
    Vec3f low = m->mesh.positions[0], high = low;
    for (const Vec3f& p : m->mesh.positions)
        for (int i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    for (int i = 0; asset.size_m != Vec3{} && i < 3; ++i)
        EXPECT_NEAR(high[i] - low[i], asset.size_m[i], asset.tolerance_m) << "axis " << i;
}
INSTANTIATE_TEST_SUITE_P(Assets, RealMesh, testing::ValuesIn(kAssets));

TEST(RealScene, StationLoadsWithItsMaterialsAndTextures) {
    const std::string mesh = asset_file("spacecraft/iss/iss.obj");
    NARPA_SKIP_WITHOUT(mesh);
    const MemoryFolder folder;
    const Result<Scene> s = read_scene(folder.write(
        "s.toml", "[sun]\ndirection = [1, 0, 0]\n[[body]]\nname = \"iss\"\nmesh = \"" + mesh +
                      "\"\n[[camera]]\nname = \"c\"\nresolution = [640, 480]\nfov_diagonal_deg = 30\n"));
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->materials.size(), 28u);
    EXPECT_EQ(s->textures.size(), 15u + 4u) << "colours, and what its four `bump` lines name";
    EXPECT_EQ(std::count_if(s->materials.begin(), s->materials.end(),
                            [](const Material& m) { return m.normal_texture >= 0; }),
              4);
    const std::set<std::string> names = [&] {
        std::set<std::string> all;
        for (const Material& m : s->materials) all.insert(m.name);
        return all;
    }();
    EXPECT_TRUE(names.contains("ISS_01_dark *")) << "names hold spaces and stars";
    for (const std::string& w : s->warnings) EXPECT_NE(w.find("triangle"), std::string::npos) << w;
}

TEST(RealMesh, PlatesMayCountFromZeroAndObjMayNot) {
    const std::string path = asset_file("smallbody/eros/eros007790.tab");
    NARPA_SKIP_WITHOUT(path);
    const Result<MeshFile> plates = read_mesh(path, 1000);
    ASSERT_TRUE(plates) << plates.error().text();
    EXPECT_EQ(plates->mesh.faces.size(), 7790u);
    ASSERT_FALSE(plates->warnings.empty());
    EXPECT_NE(plates->warnings[0].find("count vertices from 0"), std::string::npos) << plates->warnings[0];
    const MemoryFolder folder;
    std::filesystem::copy_file(path, folder / "eros.obj");
    const Result<MeshFile> m = read_mesh(folder / "eros.obj", 1000);
    ASSERT_FALSE(m);
    EXPECT_GT(m.error().line, 3897) << "after the vertices: " << m.error().text();
    EXPECT_NE(m.error().what.find("index 0"), std::string::npos);
}

/// Files that other readers tripped over: each loads, or says what is wrong.
TEST(RealMesh, ParserTrapsLoadOrAreRefusedClearly) {
    const std::string folder = asset_file("testmeshes/tinyobjloader");
    NARPA_SKIP_WITHOUT(folder);
    const std::set<std::string> bad{"catmark_torus_creases0.obj",
                                    "invalid-face-definition.obj",
                                    "invalid-relative-texture-index.obj",
                                    "invalid-relative-vertex-index.obj",
                                    "issue-140-zero-face-idx.obj",
                                    "issue-356-leading-spaces-newmtl.obj",
                                    "line-prim.obj",
                                    "points-prim.obj",
                                    "smoothing-group-two-squares.obj"};
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
        if (entry.path().extension() != ".obj") continue;
        ++files;
        const Result<MeshFile> m = read_mesh(entry.path().string(), 1);
        EXPECT_EQ(m.has_value(), !bad.contains(entry.path().filename().string()))
            << (m ? entry.path().string() : m.error().text());
        if (m) continue;
        EXPECT_EQ(m.error().file, entry.path().string());
    }
    EXPECT_GT(files, 40u);
}

}  // namespace
}  // namespace narpa
