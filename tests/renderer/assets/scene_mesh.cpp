#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/assets/meshes/mesh_readers.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::BadFile;
using test::data_file;
using test::MemoryFolder;

#define CORNERS "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

const BadFile kBadMeshes[] = {
    {"Empty", "", 0, 0, "no triangles in it"},
    {"OnlyVertices", CORNERS, 0, 0, "no triangles in it"},
    {"OnlyLines", CORNERS "l 1 2 3\np 1\n", 0, 0, "no triangles in it"},
    {"VertexOfText", "v 0 0 0\nv 1 oops 0\n", 2, 5, "\"oops\" is not a number"},
    {"VertexOfTwo", "v 0 0\n", 1, 6, "the line ends, expected a number"},
    {"VertexHalfNumber", "v 0 0 1.5x\n", 1, 7, "\"1.5x\" is not a number"},
    {"OldCompilersNaN", "v 0 0 1.#IND\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", 0, 0,
     "of its 1 triangles can be used: 1 not finite"},
    {"NormalOfText", "vn 0 a 0\n", 1, 6, "\"a\" is not a number"},
    {"CoordinateOfText", "vt 0 b\n", 1, 6, "\"b\" is not a number"},
    {"IndexZero", CORNERS "f 1 2 0\n", 4, 7, "index 0, expected indices that count from 1"},
    {"IndexOutOfRange", CORNERS "f 1 2 4\n", 4, 7, "index 4 is out of range, the file has 3 vertices"},
    {"IndexBeforeTheFirst", CORNERS "f -1 -2 -4\n", 4, 9, "index -4 is out of range, the file has 3 vertices"},
    {"IndexHuge", CORNERS "f 1 2 99999999999999999999\n", 4, 7, "is not an index"},
    {"IndexOfText", CORNERS "f 1 2 x\n", 4, 7, "\"x\" is not an index"},
    {"IndexFraction", CORNERS "f 1 2 2.5\n", 4, 7, "\"2.5\" is not an index"},
    {"CoordinateIndexOutOfRange", CORNERS "vt 0 0\nf 1/1 2/1 3/2\n", 5, 13,
     "index 2 is out of range, the file has 1 texture"},
    {"NormalIndexOutOfRange", CORNERS "f 1//1 2//1 3//1\n", 4, 6,
     "index 1 is out of range, the file has 0 normals"},
    {"TooManyParts", CORNERS "vt 0 0\nvn 0 0 1\nf 1/1/1/1 2 3\n", 6, 3, "too many parts"},
    {"NoVertexIndex", CORNERS "f 1 /2 3\n", 4, 5, "has no vertex index"},
    {"FaceOfTwo", CORNERS "f 1 2\n", 4, 1, "a face of 2 corners, expected at least 3"},
    {"PlaceAfterAContinuedLine", "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n 9\n", 6, 2, "index 9 is out of range"},
    {"TooFar", "v 0 0 0\nv 1e21 0 0\nv 0 1e21 0\nf 1 2 3\n", 0, 0,
     "reaches to 1e+21 m, expected coordinates of at most 1e+15 m"},
    {"NothingLeft", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", 0, 0, "none of its 1 triangles can be used"},
};

class BadObjFile : public testing::TestWithParam<BadFile> {};

TEST_P(BadObjFile, SaysWhereAndWhat) {
    const BadFile& bad = GetParam();
    const MemoryFolder folder;
    const std::string path = folder.write("bad.obj", bad.text);
    const Result<MeshFile> mesh = read_mesh(path, 1);
    ASSERT_FALSE(mesh);
    expect_error_of(bad, path, mesh.error());
}
INSTANTIATE_TEST_SUITE_P(Mesh, BadObjFile, testing::ValuesIn(kBadMeshes),
                         [](const auto& one) { return std::string(one.param.name); });

MeshFile good_mesh(const std::string& path, double scale = 1) {
    Result<MeshFile> mesh = read_mesh(path, scale);
    if (!mesh) {
        ADD_FAILURE() << mesh.error().text();
        return {};
    }
    return std::move(*mesh);
}

MeshFile read_obj_text(const std::string& text, double scale = 1) {
    const MemoryFolder folder;
    return good_mesh(folder.write("m.obj", text), scale);
}

Vec3 area_vector(const Mesh& m) {
    Vec3 sum;
    for (const auto& f : m.faces) {
        const Vec3 a = vec_cast<double>(m.positions[f[0]]), b = vec_cast<double>(m.positions[f[1]]),
                   c = vec_cast<double>(m.positions[f[2]]);
        sum += 0.5 * cross(b - a, c - a);
    }
    return sum;
}

double signed_volume(const Mesh& m) {
    double sum = 0;
    for (const auto& f : m.faces)
        sum += dot(vec_cast<double>(m.positions[f[0]]),
                   cross(vec_cast<double>(m.positions[f[1]]), vec_cast<double>(m.positions[f[2]]))) /
               6;
    return sum;
}

TEST(MeshFile, CubeIsClosedAndFacesOutward) {
    const MeshFile cube = good_mesh(data_file("cube.obj"), 2);
    EXPECT_EQ(cube.mesh.faces.size(), 12u);
    EXPECT_NEAR(signed_volume(cube.mesh), 8, 1e-12);
    EXPECT_LT(norm(area_vector(cube.mesh)), 1e-12);
    EXPECT_TRUE(cube.mesh.normals.empty()) << "the file gives none";
    EXPECT_EQ(cube.mesh.uvs.size(), cube.mesh.positions.size());
    EXPECT_TRUE(cube.warnings.empty());
}

/// About the origin, without normals in the file.
MeshFile smoothed_cube(double crease_rad) {
    const MemoryFolder folder;
    const std::string text =
        "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n"
        "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    const Result<MeshFile> cube = read_mesh(folder.write("cube.obj", text), 1, crease_rad);
    EXPECT_TRUE(cube) << cube.error().text();
    return *cube;
}

TEST(MeshFile, EdgesBelowTheCreaseAngleAreSmooth) {
    const MeshFile sharp = smoothed_cube(1.5), smooth = smoothed_cube(1.6);
    ASSERT_EQ(sharp.mesh.normals.size(), 24u) << "each face has its own";
    for (const Vec3f& n : sharp.mesh.normals) EXPECT_FLOAT_EQ(std::abs(n.x) + std::abs(n.y) + std::abs(n.z), 1);
    ASSERT_EQ(smooth.mesh.normals.size(), 8u) << "the faces share their corners";
    for (std::size_t i = 0; i < 8; ++i) {
        const Vec3 outward = normalized(vec_cast<double>(smooth.mesh.positions[i]));
        EXPECT_LT(norm(vec_cast<double>(smooth.mesh.normals[i]) - outward), 1e-6)
            << "by angle: however a face is cut into triangles";
    }
    EXPECT_TRUE(smoothed_cube(0).mesh.normals.empty());
}

TEST(MeshFile, ASmoothBallHasTheNormalsOfABall) {
    std::string text;
    constexpr int kAround = 48, kRings = 24;  // a vertex at each pole, where 48 triangles meet
    for (int i = 0; i <= kRings; ++i)
        for (int k = 0; k < kAround; ++k) {
            const double z = std::numbers::pi * i / kRings, turn = 2 * std::numbers::pi * k / kAround;
            text += fmt::format("v {:.17g} {:.17g} {:.17g}\n", i % kRings ? std::sin(z) * std::cos(turn) : 0.0,
                                i % kRings ? std::sin(z) * std::sin(turn) : 0.0, std::cos(z));
        }
    for (int i = 0; i < kRings; ++i)
        for (int k = 0; k < kAround; ++k) {
            const int a = i * kAround + k + 1, b = i * kAround + (k + 1) % kAround + 1;
            text += fmt::format("f {} {} {} {}\n", a, a + kAround, b + kAround, b);
        }
    const MemoryFolder folder;
    const Result<MeshFile> ball = read_mesh(folder.write("ball.obj", text), 3, 0.5);
    ASSERT_TRUE(ball) << ball.error().text();
    ASSERT_EQ(ball->mesh.normals.size(), ball->mesh.positions.size());
    EXPECT_EQ(ball->mesh.positions.size(), 2u + kAround * (kRings - 1));
    for (std::size_t i = 0; i < ball->mesh.normals.size(); ++i)
        EXPECT_LT(norm(vec_cast<double>(ball->mesh.normals[i]) - vec_cast<double>(ball->mesh.positions[i]) / 3),
                  3e-3);
}

TEST(MeshFile, NormalsOfTheFileStay) {
    const MemoryFolder folder;
    const std::string with_normals = CORNERS "vn 0 0.6 0.8\nf 1//1 2//1 3//1\n";
    const Result<MeshFile> own = read_mesh(folder.write("own.obj", with_normals), 1, 1);
    ASSERT_TRUE(own);
    EXPECT_FLOAT_EQ(own->mesh.normals[0].y, 0.6f);
    ASSERT_EQ(own->warnings.size(), 1u);
    EXPECT_NE(own->warnings[0].find("crease_angle_deg is not used"), std::string::npos) << own->warnings[0];
    // Triangles without area, and coordinates that are not finite, add nothing.
    const Result<MeshFile> odd =
        read_mesh(folder.write("odd.obj", CORNERS "v 1e300 0 0\nv 2 0 0\nf 1 2 3\nf 1 2 5\nf 1 2 4\n"), 1, 1);
    ASSERT_TRUE(odd);
    ASSERT_EQ(odd->mesh.faces.size(), 1u);
    for (const std::uint32_t v : odd->mesh.faces[0]) EXPECT_FLOAT_EQ(odd->mesh.normals[v].z, 1);
}

TEST(MeshFile, MtlBecomesLambertAndPhong) {
    const MeshFile cube = good_mesh(data_file("cube.obj"));
    ASSERT_EQ(cube.materials.size(), 2u) << "only those that are used";
    const MeshMaterial& painted = cube.materials[0];
    EXPECT_EQ(painted.material.name, "painted panel");
    EXPECT_EQ(painted.material.kind, &kinds::lambert);
    EXPECT_EQ(painted.material.diffuse, (Rgb{0.8f, 0.8f, 0.8f}));
    EXPECT_EQ(painted.colour.file, data_file("checker.ppm"));
    const Material& foil = cube.materials[1].material;
    EXPECT_EQ(foil.kind, &kinds::phong);
    EXPECT_FLOAT_EQ(foil.diffuse.x, 0.5f / 1.25f);  // 0.5 + 0.75 > 1: both divided by the largest sum
    EXPECT_FLOAT_EQ(foil.specular.x, 0.75f / 1.25f);
    EXPECT_FLOAT_EQ(foil.specular.z, 0.3f / 1.25f);
    EXPECT_EQ(foil.exponent, 60);
    EXPECT_EQ(foil.emission, (Rgb{0, 0, 2.5f}));
    EXPECT_EQ(std::count(cube.mesh.face_material.begin(), cube.mesh.face_material.end(), 1), 4);
}

TEST(MeshFile, NumbersInEveryWritingAreRead) {
    const MeshFile m =
        read_obj_text("v .5 -.5 +1.\nv 1e+00 0 0 0.3 0.3 0.3\r\nv\t1E-1  2 0 1.0 # weight\nf -3 -2 -1 # last\n");
    ASSERT_EQ(m.mesh.positions.size(), 3u);
    EXPECT_EQ(m.mesh.positions[0], (Vec3f{0.5f, -0.5f, 1}));
    EXPECT_EQ(m.mesh.positions[2], (Vec3f{0.1f, 2, 0}));
}

TEST(MeshFile, FacesMayComeBeforeTheirVertices) {
    EXPECT_EQ(read_obj_text("f 1 2 3\n" CORNERS).mesh.faces.size(), 1u);
}

TEST(MeshFile, ScaleIsAppliedInDouble) {
    // 0.1 km as float is 0.100000001490116 km; times 1000 in double before the only rounding it is 100 m exactly.
    const MeshFile m = read_obj_text("v 0.1 0 0\nv 0.2 0 0\nv 0 0.123456789 0\nf 1 2 3\n", 1000);
    EXPECT_EQ(m.mesh.positions[0].x, 100.0f);
    EXPECT_EQ(m.mesh.positions[2].y, 123.456789f);
}

TEST(MeshFile, BadTrianglesAreDroppedAndCounted) {
    const MeshFile m = read_obj_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv 0 inf 0\nv 2 0 0\nv 1e39 0 0\n"
        "f 1 2 3\nf 2 3 1\nf 3 2 1\nf 1 2 4\nf 1 2 5\nf 1 2 7\nf 1 2 6\nf 1 1 2\n");
    EXPECT_EQ(m.mesh.faces.size(), 1u);
    EXPECT_EQ(m.duplicate, 2u);
    EXPECT_EQ(m.non_finite, 3u) << "1e39 m is not a float";
    EXPECT_EQ(m.degenerate, 2u);
    ASSERT_EQ(m.warnings.size(), 3u) << "one for each kind";
    for (const Vec3f& p : m.mesh.positions) EXPECT_TRUE(is_finite(p));
}

TEST(MeshFile, DegenerateDoesNotDependOnSize) {
    for (const double scale : {1e-9, 1e-3, 1.0, 1e6}) {
        const MeshFile m = read_obj_text("v 0 0 0\nv 1 0 0\nv 0.5 1e-6 0\nv 0.5 1e-9 0\nf 1 2 3\nf 1 2 4\n", scale);
        EXPECT_EQ(m.mesh.faces.size(), 1u) << scale;
        EXPECT_EQ(m.degenerate, 1u) << scale;
    }
}

TEST(MeshFile, NormalsAreUnitAndMissingOnesAreTheFacets) {
    const MeshFile m = read_obj_text(CORNERS "v 0 0 1\nvn 0 0 -7\nvn 0 0 0\nf 1//1 2//1 3//2\nf 1 2 4\n");
    ASSERT_EQ(m.mesh.normals.size(), m.mesh.positions.size());
    EXPECT_EQ(m.mesh.normals[m.mesh.faces[0][0]], (Vec3f{0, 0, -1}));
    EXPECT_EQ(m.mesh.normals[m.mesh.faces[0][2]], (Vec3f{0, 0, 1})) << "a normal of length 0 is none";
    EXPECT_EQ(m.mesh.normals[m.mesh.faces[1][0]], (Vec3f{0, -1, 0}));
}

TEST(MeshFile, MissingMaterialsAreGreyAndTold) {
    const MeshFile m = read_obj_text("mtllib none.mtl\nusemtl red\n" CORNERS "f 1 2 3\n");
    EXPECT_EQ(m.materials.at(0).material.diffuse, (Rgb{0.5f, 0.5f, 0.5f}));
    ASSERT_EQ(m.warnings.size(), 2u);
    EXPECT_NE(m.warnings[0].find("none.mtl is not there"), std::string::npos);
    EXPECT_NE(m.warnings[1].find("\"red\"; grey 0.5 is used"), std::string::npos);
}

TEST(MeshFile, MtlErrorNamesItsOwnLine) {
    const MemoryFolder folder;
    const std::string mtl = folder.write("m.mtl", "newmtl a\n Kd 0.5 red 0\n");
    const Result<MeshFile> m = read_mesh(folder.write("m.obj", "mtllib m.mtl\nusemtl a\n" CORNERS "f 1 2 3\n"), 1);
    ASSERT_FALSE(m);
    EXPECT_EQ(m.error().text(), mtl + ":2:9: \"red\" is not a number");
}

TEST(MeshFile, TextureNamesWithSpacesOptionsAndForeignFolders) {
    const MemoryFolder folder;
    folder.write("my skin.ppm", "P3 1 1 255\n255 255 255\n");
    folder.write("m.mtl", "newmtl a\nmap_Kd -o 0.5 0 -clamp on C:\\models\\my skin.ppm  \n");
    const MeshFile m = good_mesh(
        folder.write("m.obj", "mtllib m.mtl\nusemtl a\n" CORNERS "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"));
    EXPECT_EQ(m.materials.at(0).colour.file, folder / "my skin.ppm");
    EXPECT_EQ(m.materials.at(0).material.diffuse, (Rgb{1, 1, 1})) << "no Kd under a map is 1";
}

TEST(MeshFile, MissingTextureIsHalfTheColourAndTold) {
    const MemoryFolder folder;
    folder.write("m.mtl", "newmtl a\nKd 0.8 0.4 0.2\nmap_Kd gone.png\n");
    folder.write("m.obj", "mtllib m.mtl\nusemtl a\n" CORNERS "vt 0 0\nf 1/1 2/1 3/1\n");
    const Result<Scene> s = read_scene(folder.write(
        "s.toml",
        "[ambient]\nradiance=1\n[[body]]\nname=\"b\"\nmesh=\"m.obj\"\n[[lidar]]\nname=\"l\"\nmodel=\"VLP-16\"\n"));
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->materials.at(0).texture, -1);
    EXPECT_EQ(s->materials.at(0).diffuse, (Rgb{0.4f, 0.2f, 0.1f}));
    ASSERT_EQ(s->warnings.size(), 1u);
    EXPECT_EQ(s->warnings[0], (folder / "gone.png") + ": no such file; grey 0.5 is used in place of this texture");
}

TEST(MeshFile, TextureStaysOffTrianglesWithoutCoordinates) {
    const MemoryFolder folder;
    folder.write("m.mtl", "newmtl a\nmap_Kd t.ppm\n");
    const MeshFile m = good_mesh(
        folder.write("m.obj", "mtllib m.mtl\nusemtl a\n" CORNERS "v 0 0 1\nvt 0 0\nf 1/1 2/1 3/1\nf 1 2 4\n"));
    EXPECT_TRUE(m.materials.at(m.mesh.face_material[0]).has_textures());
    EXPECT_FALSE(m.materials.at(m.mesh.face_material[1]).has_textures());
    EXPECT_EQ(m.warnings.size(), 1u);
}

TEST(MeshFile, AssimpFormatsAreRead) {
    const MemoryFolder folder;
    const MeshFile stl =
        good_mesh(folder.write("m.stl",
                               "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                               "vertex 0 1 0\nendloop\nendfacet\nendsolid s\n"),
                  1000);
    ASSERT_EQ(stl.mesh.faces.size(), 1u);
    EXPECT_NEAR(area_vector(stl.mesh).z, 0.5e6, 1e-6);
    const MeshFile ply =
        good_mesh(folder.write("m.ply",
                               "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                               "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                               "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"));
    EXPECT_EQ(ply.mesh.faces.size(), 2u);
    EXPECT_NEAR(area_vector(ply.mesh).z, 1, 1e-12);
}

// One triangle under a mirroring node: glTF 2.0, the buffer holds three positions, (0 0 0), (1 0 0), (0 1 0).
constexpr const char* kGltf = R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
"nodes": [{"mesh": 0, "scale": [-1, 1, 1], "translation": [5, 0, 0]}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
"materials": [{"name": "m", "pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.4, 0.2, 1], "metallicFactor": 0.25,
"roughnessFactor": 0.5}, "emissiveFactor": [0, 0, 1]}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
"bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri":
"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";

TEST(MeshFile, GltfNodesAndMaterialsAreApplied) {
    const MemoryFolder folder;
    const MeshFile m = good_mesh(folder.write("m.gltf", kGltf));
    ASSERT_EQ(m.mesh.faces.size(), 1u);
    EXPECT_NEAR(area_vector(m.mesh).z, 0.5, 1e-12) << "a mirrored triangle still faces the same side";
    const auto [low, high] = std::minmax_element(m.mesh.positions.begin(), m.mesh.positions.end(),
                                                 [](const Vec3f& a, const Vec3f& b) { return a.x < b.x; });
    EXPECT_EQ(low->x, 4);
    EXPECT_EQ(high->x, 5);
    const Material& material = m.materials.at(m.mesh.face_material[0]).material;
    EXPECT_EQ(material.kind, &kinds::ggx);
    EXPECT_EQ(material.diffuse, (Rgb{0.8f, 0.4f, 0.2f}));
    EXPECT_EQ(material.metallic, 0.25f);
    EXPECT_EQ(material.roughness, 0.5f);
    EXPECT_EQ(material.ior, 1.5f);
    EXPECT_EQ(material.emission, (Rgb{0, 0, 1}));
}

TEST(MeshFile, FormatsThatAreNoneGiveAnError) {
    const MemoryFolder folder;
    for (const char* name : {"m.ply", "m.stl", "m.glb", "m.gltf", "m.3ds", "m.xyz", "noextension"}) {
        const Result<MeshFile> m =
            read_mesh(folder.write(name, "this is no mesh at all, whatever its name says\n"), 1);
        ASSERT_FALSE(m) << name;
        EXPECT_EQ(m.error().file, folder / name);
    }
}

TEST(MeshFile, PlyHeaderPromisesNoMoreThanTheFileHolds) {
    const MemoryFolder folder;
    const std::string path = folder.write("m.ply",
                                          "ply\nformat ascii 1.0\nelement vertex 49999999999999999999\n"
                                          "property float x\nend_header\n0\n");
    const Result<MeshFile> m = read_mesh(path, 1);
    ASSERT_FALSE(m);
    EXPECT_EQ(m.error().text(),
              path + ":3:16: \"49999999999999999999\" is not a number of elements that this file can hold");
}

TEST(MeshFile, PlyTextHasTheValuesThatItsHeaderPromises) {
    const MemoryFolder folder;
    const std::string header =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
    const auto error_of = [&](const std::string& body) {
        const Result<MeshFile> m = read_mesh(folder.write("m.ply", header + body), 1);
        return m ? "" : m.error().text().substr((folder / "m.ply").size());
    };
    EXPECT_EQ(error_of("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 1 0\n"), "");
    EXPECT_EQ(error_of("\n0 0 0\n1 0 0\n\n0 1 0\n3 0 1 2\r\n3 2 1 0"), "");
    EXPECT_EQ(error_of("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
              ":14:1: expected \"face\" 2 of 2, with the values of its properties");
    EXPECT_EQ(error_of("0 0 0\n1 0\n0 1 0\n3 0 1 2\n3 2 1 0\n"),
              ":11:4: expected \"vertex\" 2 of 3, with the values of its properties");
    EXPECT_EQ(error_of("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 1\n"),
              ":14:6: expected \"face\" 2 of 2, with the values of its properties");
}

double area(std::span<const Vec3> p, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
    double sum = 0;
    for (const auto& t : triangles) sum += 0.5 * cross(p[t[1]] - p[t[0]], p[t[2]] - p[t[0]]).z;
    return sum;
}

TEST(Triangulate, ConcavePolygonsAreCoveredOnceWithTheSameWinding) {
    const std::vector<Vec3> arrow{{0, 0, 0}, {4, 0, 0}, {1, 1, 0}, {0, 4, 0}};  // concave at (1, 1)
    const std::vector<Vec3> comb{{0, 0, 0}, {5, 0, 0}, {5, 3, 0}, {4, 3, 0}, {4, 1, 0}, {3, 1, 0},
                                 {3, 3, 0}, {2, 3, 0}, {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}};
    for (const auto& [polygon, expected] : {std::pair(arrow, 4.0), std::pair(comb, 11.0)}) {
        const auto triangles = triangulate(polygon);
        ASSERT_EQ(triangles.size(), polygon.size() - 2);
        EXPECT_NEAR(area(polygon, triangles), expected, 1e-12);
        for (const auto& t : triangles) EXPECT_GT(area(polygon, {t}), 0) << "turned over";
    }
}

TEST(Triangulate, EveryPlaneAndHardCaseGivesAllTriangles) {
    const std::vector<Vec3> upright{{0, 0, 0}, {0, 0, 2}, {0, 2, 2}, {0, 2, 0}};
    EXPECT_EQ(triangulate(upright).size(), 2u);
    const std::vector<Vec3> bow_tie{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}, point(5, Vec3{1, 1, 1});
    EXPECT_EQ(triangulate(bow_tie).size(), 2u);
    EXPECT_EQ(triangulate(point).size(), 3u);
    const std::vector<Vec3> nothing{{0, 0, 0}, {1, 0, 0}}, nan{{0, 0, 0}, {NAN, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    EXPECT_TRUE(triangulate(nothing).empty());
    EXPECT_EQ(triangulate(nan).size(), 2u);
}

}  // namespace
}  // namespace narpa
