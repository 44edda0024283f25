#include "renderer/assets/meshes/mesh_process.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "renderer/assets/meshes/mesh_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

using test::MemoryFolder;

const std::string kAdvice = "; the file is damaged or too large, expected it exported anew, or as OBJ";

std::string corpus_file(const std::string& name) {
    return test::source_path("tests/fuzz/corpus/mesh/") + name;
}

std::string error_of(const std::string& path, const MeshReaderLimits& limits = {}) {
    const Result<TriangleSoup> soup = read_soup_in_process(path, limits);
    EXPECT_FALSE(soup);
    return soup ? "" : soup.error().text().substr(path.size());
}

TEST(MeshProcess, ACrashIsAnErrorOfTheFile) {
    const std::string path = corpus_file("crash.dae");
    const std::string error = error_of(path);
    EXPECT_EQ(error.find(": the mesh reader crashed ("), 0u) << error;
    EXPECT_NE(error.find(kAdvice), std::string::npos) << error;
}

TEST(MeshProcess, MemoryIsLimited) {
    if (NARPA_SANITIZED) GTEST_SKIP() << "sanitizers reserve more addresses than the limit";
    // A sparse accessor of 10^9 positions in a file of 500 bytes.
    EXPECT_EQ(error_of(corpus_file("bomb.gltf")), ": the mesh reader ran out of memory (limit 4 GiB)" + kAdvice);
}

TEST(MeshProcess, TimeIsLimited) {
    const MemoryFolder folder;
    ASSERT_EQ(mkfifo((folder / "endless.bin").c_str(), 0600), 0);
    const std::string path =
        folder.write("m.gltf", R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
"nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
"bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "endless.bin"}]})");
    EXPECT_EQ(error_of(path, {.seconds = 1}), ": the mesh reader took longer than 1 s" + kAdvice);
}

TEST(MeshProcess, WhatItSendsIsLimited) {
    const MemoryFolder folder;
    std::string stl = "solid s\n";
    for (int i = 0; i < 1000; ++i)
        stl += "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    const std::string path = folder.write("m.stl", stl + "endsolid s\n");
    ASSERT_TRUE(read_soup_in_process(path));
    EXPECT_NE(error_of(path, {.memory_bytes = 10'000}), "");
}

TEST(MeshProcess, OtherFormatsAreNotGivenToAssimp) {
    const MemoryFolder folder;
    const std::string blender = "BLENDER-v248" + std::string(200, '\0');
    const auto text_of = [&](const std::string& name) {
        const Result<MeshFile> mesh = read_mesh(folder.write(name, blender), 1);
        return mesh ? "" : mesh.error().what;
    };
    EXPECT_EQ(
        text_of("m.blend"),
        "not a mesh format that can be read, expected .obj, .tab, .icq, .gltf, .glb, .ply, .stl, .3ds or .dae");
    EXPECT_EQ(text_of("m.3ds"), "not a mesh that can be read: Chunk is too large") << "by the importer of its name";
}

}  // namespace
}  // namespace narpa
