// What OBJ, MTL, tables of plates, PLY and STL declare is used, or named in a warning or an error.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/constants.h"
#include "renderer/assets/meshes/mesh_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/expect_has.h"

namespace narpa {
namespace {

using test::MemoryFolder;

struct ObjOutcome {
    MeshFile file{};
    std::string warnings{}, error{};
};

ObjOutcome outcome_of(const MemoryFolder& folder, const std::string& name, const std::string& text,
                      double crease_rad = 0) {
    ObjOutcome out;
    Result<MeshFile> m = read_mesh(folder.write(name, text), 1, crease_rad);
    if (!m)
        out.error = m.error().text();
    else
        out.file = std::move(*m);
    for (const std::string& w : out.file.warnings) out.warnings += w + "\n";
    return out;
}
ObjOutcome outcome_of(const std::string& name, const std::string& text, double crease_rad = 0) {
    const MemoryFolder folder;
    return outcome_of(folder, name, text, crease_rad);
}

const std::string kCorners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

TEST(ObjDeclarations, OtherStatementsAreNamed) {
    EXPECT_EQ(outcome_of("m.obj", "# c\no a\ng b c\ns off\n" + kCorners + "f 1 2 3\ns 0\n").warnings, "");
    EXPECT_HAS(outcome_of("m.obj", kCorners + "l 1 2\np 1\ncurv 0 1 1 2\nf 1 2 3\n").warnings,
               "statements that are not used: curv, l, p\n");
    std::string many = kCorners + "f 1 2 3\n";
    for (char c = 'A'; c <= 'K'; ++c) many += std::string(3, c) + " 1\n";
    EXPECT_HAS(outcome_of("m.obj", many).warnings, "HHH and 3 others");
}

TEST(ObjDeclarations, ColoursInCommentsAreNamed) {
    EXPECT_HAS(outcome_of("m.obj", kCorners + "#MRGB ffff0000\nf 1 2 3\n").warnings, "colours in comments (#MRGB)");
}

TEST(ObjDeclarations, SmoothingGroupsAreNamedWhereNothingSmooths) {
    const std::string smooth = kCorners + "s 1\nf 1 2 3\n";
    EXPECT_HAS(outcome_of("m.obj", smooth).warnings, "smoothing groups (s) are not used; crease_angle_deg smooths");
    EXPECT_EQ(outcome_of("m.obj", smooth, 0.5).warnings, "");
    EXPECT_EQ(outcome_of("m.obj", kCorners + "vn 0 0 1\ns 1\nf 1//1 2//1 3//1\n").warnings, "");
}

TEST(ObjDeclarations, NamesMayEndInABackslash) {
    const MemoryFolder folder;
    folder.write("m.mtl", "\xef\xbb\xbfnewmtl wall\\\r\nKd 0.1 0.2 0.3\r\nPc 0\r\nPs 0.5\r\n");
    const ObjOutcome o = outcome_of(folder, "m.obj", "mtllib m.mtl\n" + kCorners + "usemtl wall\\\nf 1 2 3\n");
    ASSERT_EQ(o.error, "");
    ASSERT_EQ(o.file.mesh.faces.size(), 1u);
    EXPECT_EQ(o.file.materials.at(o.file.mesh.face_material[0]).material.diffuse, (Rgb{0.1f, 0.2f, 0.3f}));
    EXPECT_HAS(o.warnings, "m.mtl: statements that are not used: Ps\n");
}

TEST(ObjDeclarations, NormalsThatAreNotNumbersAreTheFacets) {
    for (const char* normal : {"-1.#IND 0 0", "1.#INF 0 0", "nan 0 0", "inf 0 0", "1.#QNAN 1 1"}) {
        const ObjOutcome o = outcome_of("m.obj", kCorners + "vn " + normal + "\nf 1//1 2//1 3//1\n");
        ASSERT_EQ(o.error, "") << normal;
        EXPECT_EQ(o.file.mesh.normals.at(0), (Vec3f{0, 0, 1})) << normal;
    }
}

/// A tetrahedron.
const std::string kFour = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";

std::string with_letters(const std::string& letter, const std::string& rows) {
    std::string out;
    for (std::size_t i = 0; i < rows.size(); ++i)
        out += (i == 0 || rows[i - 1] == '\n' ? letter + " " : "") + rows[i];
    return out;
}

TEST(PlateTable, FacesCountFromZeroOrOne) {
    const std::string zero = "0 2 1\n0 1 3\n0 3 2\n1 2 3\n", one = "1 3 2\n1 2 4\n1 4 3\n2 3 4\n";
    for (const auto& [faces, warning] :
         {std::pair(zero, std::string("its faces count vertices from 0\n")), std::pair(one, std::string())})
        for (const std::string& text :
             {with_letters("v", kFour) + with_letters("f", faces), "4 4\n" + kFour + faces,
              "4\n" + kFour + "4\n" + faces, "4, 4\n0, 0, 0\n1, 0, 0\n0, 1, 0\n0, 0, 1\n" + faces}) {
            const ObjOutcome o = outcome_of("m.tab", text);
            ASSERT_EQ(o.error, "") << text;
            EXPECT_EQ(o.file.mesh.faces.size(), 4u);
            EXPECT_EQ(o.file.degenerate, 0u);
            if (warning.empty())
                EXPECT_EQ(o.warnings, "");
            else
                EXPECT_HAS(o.warnings, warning);
        }
    const ObjOutcome numbered = outcome_of("m.tab", "4\n0 0 0 0\n1 1 0 0\n2 0 1 0\n3 0 0 1\n1\n0 1 2 3\n");
    EXPECT_EQ(numbered.file.mesh.positions.at(0), (Vec3f{1, 0, 0})) << "as the rows of vertices count";
    EXPECT_EQ(numbered.warnings, "");
}

TEST(PlateTable, AClosedSurfaceSaysWhereItsFacesCountFrom) {
    // The first vertex and the last are copies of others, and in no face.
    const std::string vertices = with_letters("v", "1 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n"),
                      faces = with_letters("f", "1 3 2\n1 2 4\n1 4 3\n2 3 4\n");
    const ObjOutcome o = outcome_of("m.tab", vertices + faces);
    ASSERT_EQ(o.error, "");
    EXPECT_HAS(o.warnings, "its faces count vertices from 0");
    EXPECT_EQ(o.file.mesh.positions.size(), 4u);
    const ObjOutcome open = outcome_of("m.tab", kCorners + "v 5 5 5\nf 1 2 3\n");
    EXPECT_HAS(open.warnings, "taken to count vertices from 1; none has the last one, 4");
    EXPECT_EQ(open.file.mesh.positions.at(0), (Vec3f{0, 0, 0}));
}

TEST(PlateTable, SeamsMayDifferInTheLastDigit) {
    constexpr int kLatitudes = 7, kLongitudes = 13;  // the last longitude is the first again
    std::string vertices;
    for (int i = 0; i < kLatitudes; ++i)
        for (int j = 0; j < kLongitudes; ++j) {
            const double polar = kPi * i / (kLatitudes - 1), azimuth = 2 * kPi * j / (kLongitudes - 1);
            vertices += fmt::format("v {} {} {}\n", std::sin(polar) * std::cos(azimuth),
                                    std::sin(polar) * std::sin(azimuth), std::cos(polar));
        }
    for (const int first : {0, 1}) {
        std::string faces;
        for (int i = 0; i + 1 < kLatitudes; ++i)
            for (int j = 0; j + 1 < kLongitudes; ++j) {
                const int a = i * kLongitudes + j + first, b = a + kLongitudes;
                if (i > 0) faces += fmt::format("f {} {} {}\n", a, b, a + 1);
                if (i + 2 < kLatitudes) faces += fmt::format("f {} {} {}\n", a + 1, b, b + 1);
            }
        const ObjOutcome o = outcome_of("m.tab", vertices + faces);
        ASSERT_EQ(o.error, "");
        EXPECT_HAS(o.warnings, first == 0 ? "count vertices from 0" : "taken to count vertices from 1");
        EXPECT_EQ(o.file.degenerate, 0u) << first;
    }
}

TEST(PlateTable, WhatCannotBeReadIsNamed) {
    const auto error = [](const std::string& text) { return outcome_of("m.tab", text).error; };
    EXPECT_HAS(error("1 2 3\n4 5 6\n"), ":1:1: expected lines of v and f, or the numbers of vertices and of faces");
    EXPECT_HAS(error("3 1\n0 0 0\n1 0 0\n0 1 0\n"), "the file ends, expected the rows that its counts promise");
    EXPECT_HAS(error("3 1\n0 0 0\n1 0\n0 1 0\n1 2 3\n"), ":3:1: expected three numbers");
    EXPECT_HAS(error("3 1\n0 0 0\n1 0 x\n"), ":3:5: \"x\" is not a number");
    EXPECT_HAS(error("3 1\n0 0 0\n1 0 0\n0 1 0\n1 2 7\n"), ":5:1: a face with vertex 7, the file has 3");
    EXPECT_HAS(error("3 1\n0 0 0\n1 0 0\n0 1 0\n0 2 3\n"), "faces with vertices 0 to 3, the file has 3");
    EXPECT_HAS(error(kCorners + "f 0 1 3\n"), "faces with vertices 0 to 3, the file has 3");
    EXPECT_HAS(error(kCorners + "f 1 2 4\n"), ":4:7: index 4 is out of range");
}

TEST(PlyDeclarations, StripsWedgesAndTexturesAreUsed) {
    const std::string head =
        "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 4\nproperty float x\n"
        "property float y\nproperty float z\n";
    const std::string vertices = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n";
    const ObjOutcome strips =
        outcome_of("m.ply", head + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n" +
                                vertices + "8 0 1 2 3 -1 3 1 0\n");
    ASSERT_EQ(strips.error, "");
    EXPECT_EQ(strips.file.mesh.faces.size() + strips.file.duplicate, 3u);
    const ObjOutcome wedges = outcome_of("m.ply", head +
                                                      "element face 1\nproperty list uchar int vertex_indices\n"
                                                      "property list uchar float texcoord\nend_header\n" +
                                                      vertices + "4 0 1 3 2 8 0 0 1 0 1 1 0 0.5\n");
    ASSERT_EQ(wedges.error, "");
    EXPECT_EQ(wedges.warnings, "");
    const auto& mesh = wedges.file.mesh;
    EXPECT_TRUE(wedges.file.materials.at(mesh.face_material.at(0)).colour.file.ends_with("/t.png"));
    ASSERT_EQ(mesh.faces.size(), 2u);
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
        EXPECT_EQ(mesh.uvs[i][1], mesh.positions[i].y * (mesh.positions[i].x > 0 ? 1 : 0.5f));
}

TEST(PlyDeclarations, FacesMayComeBeforeTheVertices) {
    const std::string vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n",
                      faces = "element face 1\nproperty list uchar int vertex_indices\n";
    const ObjOutcome o = outcome_of(
        "m.ply", "ply\nformat ascii 1.0\n" + faces + vertices + "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 2 0\n");
    ASSERT_EQ(o.error, "");
    EXPECT_EQ(o.warnings, "");
    ASSERT_EQ(o.file.mesh.faces.size(), 1u);
    EXPECT_EQ(o.file.mesh.positions.at(o.file.mesh.faces[0][2]), (Vec3f{0, 2, 0}));
    EXPECT_HAS(outcome_of("m.ply", "ply\nformat ascii 1.0\n" + faces + vertices +
                                       "end_header\n3 0 1 3\n0 0 0\n1 0 0\n0 2 0\n")
                   .error,
               "a face has vertex 3, counted from 0, of 3");
}

TEST(PlyDeclarations, TheRestIsNamed) {
    const auto read = [](const std::string& more, const std::string& format = "ascii") {
        return outcome_of("m.ply", "ply\nformat " + format +
                                       " 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                       "property float z\nproperty float quality\n" +
                                       more +
                                       "element face 1\nproperty list uchar int vertex_indices\nelement edge 1\n"
                                       "property int vertex1\nend_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2\n0\n");
    };
    EXPECT_HAS(read("").warnings, "elements and properties that are not used: edge, vertex.quality\n");
    EXPECT_HAS(read("property quad a\n").error, ":8:10: expected a property with one of PLY's types");
    EXPECT_HAS(read("", "utf8").error, ":2:8: \"utf8\", expected ascii, binary_little_endian or binary_big_endian");
    EXPECT_HAS(read("", "binary_little_endian").error, "expected \"vertex\" 3 of 3");
    EXPECT_HAS(
        outcome_of("m.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n").error,
        "its vertices have no x, y and z");
    EXPECT_HAS(
        outcome_of("m.ply",
                   "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
                   "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 1 2\n")
            .error,
        "a face has vertex 1, counted from 0, of 1");
}

TEST(StlDeclarations, TextMayBeInCapitals) {
    const std::string facet =
        "FACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 0 0 0\nVERTEX 1 0 0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\n";
    EXPECT_EQ(outcome_of("m.stl", "SOLID X\n" + facet + "ENDSOLID X\n").file.mesh.faces.size(), 1u);
    EXPECT_EQ(outcome_of("m.stl", "\xef\xbb\xbfsolid\r" + facet + "endsolid\r").file.mesh.faces.size(), 1u);
    EXPECT_HAS(outcome_of("m.stl", "solid x\ncolour 1 0 0\n" + facet).warnings, "words that are not used: colour");
    EXPECT_HAS(outcome_of("m.stl", "solid x\nfacet normal 0 0 1\nvertex 0 0 0\nendfacet\n").error,
               ":4:1: a facet of 1 vertices, expected 3");
    EXPECT_HAS(outcome_of("m.stl", "solid x\nfacet normal 0 0 1\nvertex 0 0 0\n").error,
               "the file ends within a facet");
    EXPECT_HAS(outcome_of("m.stl", "solid x\nfacet normal 0 0 one\n").error,
               ":2:18: \"one\" where a number was expected");
    EXPECT_HAS(outcome_of("m.stl", std::string(80, ' ') + std::string("\2\0\0\0", 4) + std::string(60, '\0')).error,
               "144 bytes, expected 184");
}

}  // namespace
}  // namespace narpa
