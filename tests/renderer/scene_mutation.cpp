/// Thousands of damaged scenes and meshes: every one is read or refused with a place, and none takes the reader
/// down.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "renderer/scene/mesh_file.h"
#include "renderer/scene/scene_file.h"
#include "tests/renderer/scene_support.h"

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

void expect_sound(const Material& m, int textures) {
    for (const int t : {m.texture, m.emission_texture, m.normal_texture, m.height_texture}) ASSERT_LT(t, textures);
    const bool adds_up = m.kind == Material::Kind::phong;
    for (int b = 0; b < 3; ++b) {
        ASSERT_TRUE(m.diffuse[b] >= 0 && m.specular[b] >= 0 && m.emission[b] >= 0 && m.ambient[b] >= 0);
        ASSERT_LE(adds_up ? m.diffuse[b] + m.specular[b] : std::max(m.diffuse[b], m.specular[b]), 1 + 1e-6f);
    }
    ASSERT_TRUE(m.roughness >= 0 && m.roughness <= 1 && m.metallic >= 0 && m.metallic <= 1);
    ASSERT_TRUE(m.ior >= 0.1f && m.ior <= 10 && std::abs(m.asymmetry) < 1 && m.exponent >= 0);
    ASSERT_TRUE(std::isfinite(m.normal_scale) && std::isfinite(m.bump_height_m));
}

void expect_told(const Error& e) {
    EXPECT_EQ(e.kind, ErrorKind::bad_input);
    EXPECT_FALSE(e.file.empty());
    EXPECT_FALSE(e.what.empty());
}

TEST(Mutation, SceneTextNeverTakesTheReaderDown) {
    const TemporaryFolder folder;
    for (const char* name : {"cube.obj", "cube.mtl", "checker.ppm", "normals.ppm"})
        std::filesystem::copy_file(data_file(name), folder / name);
    const std::string all = test::read_text(data_file("complete.toml"));
    // Reading Hapke's parameters takes milliseconds, as what they send back is summed: in one scene of ten.
    const std::size_t hapke = all.find("[[body]]\nname = \"phobos\""), next = all.find("[[body]]", hapke + 1);
    ASSERT_LT(next, all.size());
    const std::string quick = all.substr(0, hapke) + all.substr(next);
    Mutator mutator(20'260'301);
    int read = 0, refused = 0;
    for (int i = 0; i < 3000; ++i) {
        const Result<Scene> scene = read_scene(folder.write("s.toml", mutator.mutated(i % 10 == 0 ? all : quick)));
        if (!scene) {
            expect_told(scene.error());
            EXPECT_GE(scene.error().line, 1);
            ++refused;
            continue;
        }
        ++read;
        for (const Mesh& m : scene->meshes) expect_sound(m, scene->materials.size());
        for (const Material& m : scene->materials) expect_sound(m, static_cast<int>(scene->textures.size()));
        for (const Light& l : scene->lights) {
            ASSERT_LT(l.mount, static_cast<int>(scene->bodies.size()));
            ASSERT_TRUE(l.width_m > 0 && l.height_m > 0 && l.radius_m > 0);
            ASSERT_TRUE(is_finite(l.emission) && std::max({l.emission.x, l.emission.y, l.emission.z}) > 0);
            ASSERT_NEAR(norm(l.T_mount_light.q), 1, 1e-12);
        }
        for (const Camera& c : scene->cameras) {
            ASSERT_LT(c.mount, static_cast<int>(scene->bodies.size()));
            ASSERT_TRUE(c.fx > 0 && c.fy > 0 && c.period_ns > 0 && std::isfinite(c.fx));
            ASSERT_NEAR(norm(c.T_mount_camera.q), 1, 1e-12);
            ASSERT_TRUE(!c.lens || (c.lens->aperture_diameter_m > 0 && c.lens->focus_distance_m > 0));
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
    const std::string mtl =
        test::read_text(data_file("cube.mtl")) +
        "d 0.5\nNi 1.5\nillum 7\nnewmtl foil\nPr 0.3\nPm 1\nKe 0 1 0\nmap_Ke -clamp on checker.ppm\n"
        "map_Bump -bm 0.2 checker.ppm\nnorm checker.ppm\n";
    Mutator mutator(4);
    int read = 0, refused = 0;
    for (int i = 0; i < 6000; ++i) {
        const bool damage_mtl = i % 4 == 0;
        folder.write("cube.mtl", damage_mtl ? mutator.mutated(mtl) : mtl);
        const Result<MeshFile> mesh = read_mesh(folder.write("m.obj", damage_mtl ? obj : mutator.mutated(obj)), 3);
        if (mesh) {
            expect_sound(mesh->mesh, mesh->materials.size());
            for (const MeshMaterial& m : mesh->materials) expect_sound(m.material, 0);
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
    const std::string gltf = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
"nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
"extensionsUsed": ["KHR_materials_transmission", "KHR_materials_ior"],
"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.2, 1], "metallicFactor": 0.25,
"roughnessFactor": 0.5, "baseColorTexture": {"index": 0}}, "emissiveFactor": [0, 0, 1],
"normalTexture": {"index": 0, "scale": 0.5}, "emissiveTexture": {"index": 0},
"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.3}, "KHR_materials_ior": {"ior": 1.33}}}],
"images": [{"uri": "a.png"}], "samplers": [{"wrapS": 33071}], "textures": [{"source": 0, "sampler": 0}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
"bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri":
"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";
    const std::array<std::pair<const char*, const std::string*>, 3> formats{
        {{"m.ply", &ply}, {"m.stl", &stl}, {"m.gltf", &gltf}}};
    Mutator mutator(11);
    for (std::size_t i = 0; i < 90; ++i) {  // a process each
        const auto& [name, good] = formats[i % formats.size()];
        const Result<MeshFile> mesh = read_mesh(folder.write(name, mutator.mutated(*good)), 1);
        if (mesh) {
            expect_sound(mesh->mesh, mesh->materials.size());
            for (const MeshMaterial& m : mesh->materials) expect_sound(m.material, 0);
        } else {
            expect_told(mesh.error());
        }
    }
}

}  // namespace
}  // namespace narpa
