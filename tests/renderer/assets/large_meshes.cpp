// Large meshes, which are read and welded in parts: as small ones, whatever the number of threads.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <bit>
#include <cmath>
#include <map>
#include <random>

#include "renderer/assets/meshes/equal_keys.h"
#include "renderer/assets/meshes/mesh_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::MemoryFolder;
using Key = std::array<std::uint32_t, 2>;

std::vector<std::uint32_t> least_equal_one_by_one(const std::vector<Key>& keys) {
    std::map<Key, std::uint32_t> seen;
    std::vector<std::uint32_t> out;
    for (std::uint32_t i = 0; i < keys.size(); ++i) out.push_back(seen.try_emplace(keys[i], i).first->second);
    return out;
}

TEST(EqualKeys, EachHasTheLeastItemWithItsKey) {
    std::mt19937 random(3);
    for (const std::size_t n : {0u, 1u, 2u, 1000u, 200'000u})
        for (const std::uint32_t distinct : {1u, 300u, 1'000'000u}) {
            std::vector<Key> keys(n);
            for (Key& key : keys)
                key = {static_cast<std::uint32_t>(random() % distinct), static_cast<std::uint32_t>(random() % 2)};
            EXPECT_EQ(least_equal(n, [&](std::size_t i) { return keys[i]; }), least_equal_one_by_one(keys))
                << n << " of " << distinct;
        }
}

/// A wavy sheet of n x n vertices with faces of three, four and five corners, some of them twice.
struct Sheet {
    std::vector<std::array<float, 5>> vertices;  // x, y, z, s, t
    std::vector<std::vector<std::uint32_t>> faces;

    explicit Sheet(std::uint32_t n) {
        for (std::uint32_t j = 0; j < n; ++j)
            for (std::uint32_t i = 0; i < n; ++i) {
                const auto x = static_cast<float>(i), y = static_cast<float>(j);
                vertices.push_back({x, y, 0.25f * std::sin(x + 2 * y), x / 64, y / 64});
            }
        for (std::uint32_t j = 0; j + 1 < n; ++j)
            for (std::uint32_t i = 0; i + 2 < n; i += 2) {
                const std::uint32_t a = j * n + i, b = a + 1, c = a + 2, d = a + n, e = b + n, f = c + n;
                if (j < n / 3) {
                    for (const auto& t : {std::array{a, b, d}, {b, e, d}, {b, c, e}, {c, f, e}})
                        faces.emplace_back(t.begin(), t.end());
                } else if (j < n / 2) {
                    faces.push_back({a, b, e, d}), faces.push_back({b, c, f, e});
                } else {
                    faces.push_back({a, b, c, f, d}), faces.push_back({d, e, b});
                }
            }
        for (std::size_t i = 0; i < faces.size(); i += 997) faces.push_back(faces[i]);
    }

    [[nodiscard]] std::string header(const std::string& format) const {
        std::string out =
            "ply\nformat " + format + " 1.0\nelement vertex " + std::to_string(vertices.size()) + "\n";
        for (const char* name : {"x", "y", "z", "s", "t"}) out += std::string("property float ") + name + "\n";
        return out + "element face " + std::to_string(faces.size()) +
               "\nproperty list uchar uint vertex_indices\nend_header\n";
    }
    [[nodiscard]] std::string binary() const {
        std::string out =
            header(std::endian::native == std::endian::little ? "binary_little_endian" : "binary_big_endian");
        const auto put = [&](const auto& x) { out.append(reinterpret_cast<const char*>(&x), sizeof x); };
        for (const auto& v : vertices) put(v);
        for (const auto& face : faces) {
            put(static_cast<std::uint8_t>(face.size()));
            for (const std::uint32_t v : face) put(v);
        }
        return out;
    }
    [[nodiscard]] std::string text() const {
        std::string out = header("ascii");
        for (const auto& v : vertices) out += fmt::format("{} {} {} {} {}\n", v[0], v[1], v[2], v[3], v[4]);
        for (const auto& face : faces) out += fmt::format("{} {}\n", face.size(), fmt::join(face, " "));
        return out;
    }
};

void expect_equal(const Mesh& a, const Mesh& b) {
    EXPECT_TRUE(a.positions == b.positions);
    EXPECT_TRUE(a.uvs == b.uvs);
    EXPECT_TRUE(a.faces == b.faces);
    EXPECT_TRUE(a.face_material == b.face_material);
}

TEST(LargeMeshes, BinaryFacesOfAllSizesAreThoseOfTheText) {
    const MemoryFolder folder;
    const Sheet sheet(301);
    const Result<MeshFile> binary = read_mesh(folder.write("binary.ply", sheet.binary()), 2),
                           text = read_mesh(folder.write("text.ply", sheet.text()), 2);
    ASSERT_TRUE(binary && text);
    EXPECT_GT(binary->mesh.faces.size(), 150'000u);
    EXPECT_GT(binary->duplicate, 100u);
    EXPECT_EQ(binary->duplicate, text->duplicate);
    expect_equal(binary->mesh, text->mesh);
}

TEST(LargeMeshes, DoNotDependOnTheNumberOfThreads) {
    const MemoryFolder folder;
    const std::string path = folder.write("m.ply", Sheet(301).binary());
    const Result<MeshFile> with_all = read_mesh(path, 1);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const Result<MeshFile> with_one = read_mesh(path, 1);
    ASSERT_TRUE(with_all && with_one);
    expect_equal(with_all->mesh, with_one->mesh);
}

TEST(LargeMeshes, ErrorsAreThoseOfTheFirstBadFace) {
    const MemoryFolder folder;
    Sheet sheet(301);
    sheet.faces[70'000][1] = 1'000'000;
    sheet.faces[80'000][1] = 2'000'000;
    const Result<MeshFile> bad = read_mesh(folder.write("m.ply", sheet.binary()), 1);
    ASSERT_FALSE(bad);
    EXPECT_EQ(bad.error().what, "a face has vertex 1000000, counted from 0, of 90601");
    const std::string cut = Sheet(301).binary();
    const Result<MeshFile> ends = read_mesh(folder.write("m.ply", cut.substr(0, cut.size() - 1)), 1);
    ASSERT_FALSE(ends);
    EXPECT_NE(ends.error().what.find("with the values of its properties"), std::string::npos) << ends.error().what;
}

}  // namespace
}  // namespace narpa
