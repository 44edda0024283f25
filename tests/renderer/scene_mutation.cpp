/// Thousands of damaged scenes and meshes: every one is read or refused with a place, and none takes the reader
/// down.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "renderer/scene/mesh_file.h"
#include "renderer/scene/scene_file.h"
#include "tests/renderer/scene_support.h"

/// Assimp forgets memory when it gives up on a file; that is not ours to mend.
extern "C" const char* __lsan_default_suppressions() {
    return "leak:libassimp";
}

namespace narpa {
namespace {

using test::data_file;
using test::TemporaryFolder;

class Mutator {
public:
    explicit Mutator(std::uint64_t seed) : random_(seed) {}

    std::string mutated(std::string text) {
        for (std::size_t n = 1 + below(4); n > 0 && !text.empty(); --n) mutate(text);
        return text;
    }

private:
    std::size_t below(std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_); }

    void mutate(std::string& text) {
        static constexpr const char* kTokens[] = {
            "nan", "-inf",    "1e400",      "-0",   "0",  "99999999999999999999",
            "-1",  "[",       "]",          "{",    "\"", "#",
            "\n",  "\\\n",    "= ",         "1/",   "//", "f ",
            "v ",  "usemtl ", "[[body]]\n", "\xff", ".",  "1e-400"};
        const std::size_t at = below(text.size());
        const std::size_t length = std::min(1 + below(12), text.size() - at);
        switch (below(10)) {
            case 0: text[at] = static_cast<char>(below(256)); break;
            case 1: text.erase(at, length); break;
            case 2: text.insert(at, text.substr(below(text.size()), length)); break;
            case 3: text.insert(at, kTokens[below(std::size(kTokens))]); break;
            case 4: text.replace(at, length, kTokens[below(std::size(kTokens))]); break;
            case 5: text.resize(below(8) > 0 ? text.size() - 1 : at); break;
            default: replace_digit(text, at);
        }
    }
    /// Mild damage: the text stays what it is, a number in it does not.
    void replace_digit(std::string& text, std::size_t from) {
        const std::size_t digit = text.find_first_of("0123456789", from);
        if (digit != std::string::npos) text[digit] = static_cast<char>('0' + below(10));
    }

    std::mt19937_64 random_;
};

void expect_sound(const Mesh& m, std::size_t materials) {
    ASSERT_FALSE(m.faces.empty());
    ASSERT_EQ(m.face_material.size(), m.faces.size());
    ASSERT_TRUE(m.normals.empty() || m.normals.size() == m.positions.size());
    ASSERT_TRUE(m.uvs.empty() || m.uvs.size() == m.positions.size());
    for (const auto& face : m.faces)
        for (const std::uint32_t corner : face) ASSERT_LT(corner, m.positions.size());
    for (const std::uint16_t material : m.face_material) ASSERT_LT(material, materials);
    for (const Vec3f& p : m.positions) ASSERT_TRUE(is_finite(p));
    for (const Vec3f& n : m.normals) ASSERT_NEAR(norm(n), 1, 1e-5);
}

void expect_told(const Error& e) {
    EXPECT_EQ(e.kind, ErrorKind::bad_input);
    EXPECT_FALSE(e.file.empty());
    EXPECT_FALSE(e.what.empty());
}

TEST(Mutation, SceneTextNeverTakesTheReaderDown) {
    const TemporaryFolder folder;
    for (const char* name : {"cube.obj", "cube.mtl", "checker.ppm"})
        std::filesystem::copy_file(data_file(name), folder / name);
    const std::string good = test::read_text(data_file("complete.toml"));
    Mutator mutator(20'260'301);
    int read = 0, refused = 0;
    for (int i = 0; i < 3000; ++i) {
        const Result<Scene> scene = read_scene(folder.write("s.toml", mutator.mutated(good)));
        if (!scene) {
            expect_told(scene.error());
            EXPECT_GE(scene.error().line, 1);
            ++refused;
            continue;
        }
        ++read;
        for (const Mesh& m : scene->meshes) expect_sound(m, scene->materials.size());
        for (const Material& m : scene->materials) ASSERT_LT(m.texture, static_cast<int>(scene->textures.size()));
        for (const Camera& c : scene->cameras) {
            ASSERT_LT(c.mount, static_cast<int>(scene->bodies.size()));
            ASSERT_TRUE(c.fx > 0 && c.fy > 0 && c.period_ns > 0 && std::isfinite(c.fx));
            ASSERT_NEAR(norm(c.T_mount_camera.q), 1, 1e-12);
        }
        for (const Body& b : scene->bodies) ASSERT_NEAR(norm(b.initial.T_world_body.q), 1, 1e-12);
    }
    EXPECT_GT(read, 100) << "the damage is too heavy to test what comes after the reading";
    EXPECT_GT(refused, 1000);
}

TEST(Mutation, ObjAndMtlTextNeverTakeTheReaderDown) {
    const TemporaryFolder folder;
    const std::string obj =
        test::read_text(data_file("cube.obj")) + "vn 0 0 1\nf 5/1/1 6/2/1 7/3/-1\nf 1 2 3 4 5 6 7 8\n";
    const std::string mtl = test::read_text(data_file("cube.mtl"));
    Mutator mutator(4);
    int read = 0, refused = 0;
    for (int i = 0; i < 6000; ++i) {
        const bool damage_mtl = i % 4 == 0;
        folder.write("cube.mtl", damage_mtl ? mutator.mutated(mtl) : mtl);
        const Result<MeshFile> mesh = read_mesh(folder.write("m.obj", damage_mtl ? obj : mutator.mutated(obj)), 3);
        if (mesh) {
            expect_sound(mesh->mesh, mesh->materials.size());
            for (const MeshMaterial& m : mesh->materials)
                for (int b = 0; b < 3; ++b) ASSERT_LE(m.material.diffuse[b] + m.material.specular[b], 1 + 1e-6f);
            ++read;
        } else {
            expect_told(mesh.error());
            ++refused;
        }
    }
    EXPECT_GT(read, 1000);
    EXPECT_GT(refused, 1000);
}

TEST(Mutation, OtherMeshFormatsNeverTakeTheReaderDown) {
    const TemporaryFolder folder;
    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 "
        "2\n3 0 2 3\n";
    const std::string stl =
        "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 "
        "0\nendloop\nendfacet\nendsolid s\n";
    Mutator mutator(11);
    for (int i = 0; i < 1000; ++i) {
        const bool is_ply = i % 2 == 0;
        const auto path = folder.write(is_ply ? "m.ply" : "m.stl", mutator.mutated(is_ply ? ply : stl));
        const Result<MeshFile> mesh = read_mesh(path, 1);
        if (mesh) {
            expect_sound(mesh->mesh, mesh->materials.size());
        } else {
            expect_told(mesh.error());
        }
    }
}

}  // namespace
}  // namespace narpa
