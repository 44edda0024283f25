/// What the materials of mesh files become: the rules of docs/meshes.md.
#include <gtest/gtest.h>

#include <array>

#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/image_files.h"

namespace narpa {
namespace {

using test::MemoryFolder;

constexpr const char* kTriangle =
    "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";

MeshFile read_mtl(const std::string& statements) {
    const MemoryFolder folder;
    folder.write("m.mtl", "newmtl a\n" + statements + "\n");
    Result<MeshFile> m = read_mesh(folder.write("m.obj", kTriangle), 1);
    if (!m) {
        ADD_FAILURE() << m.error().text();
        return {};
    }
    return std::move(*m);
}

Material from(const std::string& statements) {
    const MeshFile m = read_mtl(statements);
    return m.materials.empty() ? Material{} : m.materials[0].material;
}

TEST(MtlMaterial, GlassNeedsRefractionTransparencyAndAnIndex) {
    for (const char* illum : {"4", "6", "7", "9"}) {
        const Material glass =
            from(std::string("Kd 0 0 0\nKs 1 1 1\nNs 1000\nPr 0.1\nd 0.2\nNi 1.45\nillum ") + illum);
        EXPECT_EQ(glass.kind, &kinds::dielectric) << illum;
        EXPECT_EQ(glass.ior, 1.45f);
    }
    EXPECT_EQ(from("Tr 0.9\nNi 1.3\nillum 7").kind, &kinds::dielectric);
    EXPECT_EQ(from("d 0.2\nNi 1.45\nillum 2").kind, &kinds::lambert) << "no refraction asked for";
    EXPECT_EQ(from("d 1\nNi 1.45\nillum 7").kind, &kinds::lambert) << "opaque";
    EXPECT_EQ(from("d 1\nTr 1\nNi 1.45\nillum 7").kind, &kinds::lambert) << "d says more than Tr";
    EXPECT_EQ(from("d 0.2\nNi 1\nillum 7").kind, &kinds::lambert) << "does not refract";
    EXPECT_EQ(from("d 0.2\nillum 7").kind, &kinds::lambert);
}

TEST(MtlMaterial, TransparentWithoutRefractionIsOpaqueAndTold) {
    const MeshFile pane = read_mtl("d 0.2\nillum 2"), glass = read_mtl("d 0.2\nNi 1.5\nillum 7");
    ASSERT_EQ(pane.warnings.size(), 1u);
    EXPECT_NE(pane.warnings[0].find("1 material: transparent (d, Tr), drawn opaque"), std::string::npos);
    EXPECT_TRUE(glass.warnings.empty());
}

TEST(MtlMaterial, RoughnessOrMetallicIsGgx) {
    const Material foil = from("Kd 0.9 0.7 0.3\nKs 1 1 1\nPr 0.25\nPm 0.75\nNi 1.6");
    EXPECT_EQ(foil.kind, &kinds::ggx);
    EXPECT_EQ(foil.diffuse, (Rgb{0.9f, 0.7f, 0.3f}));
    EXPECT_EQ((std::array{foil.roughness, foil.metallic, foil.ior}), (std::array{0.25f, 0.75f, 1.6f}));
    const Material paint = from("Pr 0.3");
    EXPECT_EQ(paint.metallic, 0);
    EXPECT_EQ(paint.ior, 1.5f);
    const Material metal = from("Pm 1\nNi 1");
    EXPECT_EQ(metal.roughness, 0.5f);
    EXPECT_EQ(metal.ior, 1.5f);
    const Material damaged = from("Pr nan\nPm 7\nNi inf\nKd 2 -1 nan");
    EXPECT_EQ((std::array{damaged.roughness, damaged.metallic, damaged.ior}), (std::array{0.0f, 1.0f, 3.0f}));
    EXPECT_EQ(damaged.diffuse, (Rgb{1, 0, 0}));
}

TEST(MtlMaterial, MirrorIsPolishedBlackAndRayTraced) {
    for (const char* illum : {"3", "5"}) {
        const Material mirror = from(std::string("Kd 0 0 0\nKs 0.9 0.9 0.8\nNs 1000\nillum ") + illum);
        EXPECT_EQ(mirror.kind, &kinds::mirror);
        EXPECT_EQ(mirror.specular, (Rgb{0.9f, 0.9f, 0.8f}));
    }
    EXPECT_EQ(from("Kd 0 0 0\nKs 0.9 0.9 0.8\nNs 1000\nillum 2").kind, &kinds::phong);
    EXPECT_EQ(from("Kd 0 0 0\nKs 0.9 0.9 0.8\nNs 900\nillum 3").kind, &kinds::phong);
    EXPECT_EQ(from("Kd 0 0.1 0\nKs 0.9 0.9 0.8\nNs 1000\nillum 3").kind, &kinds::phong);
    EXPECT_EQ(from("Kd 0 0 0\nNs 1000\nillum 3").kind, &kinds::lambert) << "reflects nothing";
}

TEST(MtlMaterial, IllumWithoutHighlightIsLambert) {
    EXPECT_EQ(from("Ks 0.3 0.3 0.3\nillum 1").kind, &kinds::lambert);
    EXPECT_EQ(from("Ks 0.3 0.3 0.3\nillum 0").kind, &kinds::lambert);
    EXPECT_EQ(from("Ks 0.3 0.3 0.3").kind, &kinds::phong);
    EXPECT_EQ(from("Ks 0.3 0.3 0.3\nillum 2").kind, &kinds::phong);
}

TEST(MtlMaterial, MapsCarryTheirOptions) {
    const MeshFile m = read_mtl(
        "map_Kd -clamp on -s 2 2 a b.png\nmap_Ke glow.png\nmap_Bump -imfchan l -bm 0.02 -clamp off h.png\nnorm "
        "n.png\n"
        "map_Pr r.png\nmap_d d.png");
    const MeshMaterial& a = m.materials.at(0);
    EXPECT_TRUE(a.colour.file.ends_with("/a b.png"));
    EXPECT_EQ(a.colour.wrap, Texture::Wrap::clamp);
    EXPECT_TRUE(a.emission.file.ends_with("/glow.png"));
    EXPECT_EQ(a.material.emission, (Rgb{1, 1, 1})) << "no Ke under a map_Ke is 1";
    EXPECT_TRUE(a.normal.file.ends_with("/n.png"));
    EXPECT_TRUE(a.bump.file.ends_with("/h.png"));
    EXPECT_EQ(a.bump.wrap, Texture::Wrap::repeat);
    EXPECT_EQ(a.bump_multiplier, 0.02f);
    ASSERT_EQ(m.warnings.size(), 2u);
    EXPECT_NE(m.warnings[0].find("2 materials: options of maps passed over, all but -clamp and -bm"),
              std::string::npos)
        << m.warnings[0];
    EXPECT_NE(m.warnings[1].find("maps that are not used: map_Pr, map_d"), std::string::npos) << m.warnings[1];
    EXPECT_EQ(from("Ke 0 0 0\nmap_Ke glow.png").emission, Rgb{});
}

TEST(MtlMaterial, BadNumbersAreNamed) {
    const MemoryFolder folder;
    const std::string obj = folder.write("m.obj", kTriangle);
    for (const auto& [line, column, words] : {std::tuple("Pr rough", 4, "\"rough\" is not a number"),
                                              {"illum x", 7, "\"x\" is not a number"},
                                              {"d -halo y", 9, "\"y\" is not a number"},
                                              {"bump -bm z b.png", 10, "\"z\" is not a finite number"},
                                              {"bump -bm inf b.png", 10, "\"inf\" is not a finite number"},
                                              {"Ni", 3, "\"\" is not a number"}}) {
        folder.write("m.mtl", std::string("newmtl a\n") + line + "\n");
        const Result<MeshFile> m = read_mesh(obj, 1);
        ASSERT_FALSE(m) << line;
        EXPECT_EQ(m.error().line, 2) << m.error().text();
        EXPECT_EQ(m.error().column, column) << m.error().text();
        EXPECT_NE(m.error().what.find(words), std::string::npos) << m.error().text();
    }
}

/// The scene of one triangle with an MTL of these statements, beside pictures of normals, of heights, of grey.
class BumpMap : public testing::Test {
protected:
    BumpMap() {
        test::write_image_file(folder_ / "normals.png",
                               cv::Mat(4, 4, CV_8UC3, cv::Scalar(255, 128, 128)));  // blue first
        test::write_image_file(folder_ / "heights.png", cv::Mat(4, 4, CV_8UC1, cv::Scalar(128)));
        folder_.write("m.obj", kTriangle);
    }
    Scene read(const std::string& statements, const char* scale = "1") {
        folder_.write("m.mtl", "newmtl a\n" + statements + "\n");
        Result<Scene> s = read_scene(folder_.write(
            "s.toml", std::string("[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nmesh = \"m.obj\"\nscale = ") +
                          scale + "\n[[lidar]]\nname = \"l\"\nmodel = \"VLP-16\"\n"));
        if (!s) {
            ADD_FAILURE() << s.error().text();
            return {};
        }
        return std::move(*s);
    }
    MemoryFolder folder_;
};

TEST_F(BumpMap, BluePictureHoldsNormals) {
    for (const char* statement : {"bump normals.png", "map_bump normals.png", "map_Bump normals.png",
                                  "norm normals.png", "bump normals.png\nnorm normals.png"}) {
        const Scene s = read(statement);
        ASSERT_EQ(s.textures.size(), 1u) << statement;
        EXPECT_EQ(s.materials.at(0).normal_texture, 0);
        EXPECT_EQ(s.materials.at(0).height_texture, -1);
        EXPECT_EQ(s.materials.at(0).normal_scale, 1);
        EXPECT_NEAR(s.textures[0].rgb[0], 65535 * 0.5, 0.5) << "read as a normal map";
        EXPECT_TRUE(s.warnings.empty());
    }
    EXPECT_EQ(read("bump -bm 0.5 normals.png").materials.at(0).normal_scale, 0.5f);
    EXPECT_EQ(read("norm -bm 0.5 normals.png").materials.at(0).normal_scale, 0.5f);
}

TEST_F(BumpMap, GreyPictureHoldsHeightsInUnitsOfTheMesh) {
    const Scene s = read("bump -bm 0.02 heights.png", "1000");
    ASSERT_EQ(s.textures.size(), 1u);
    EXPECT_EQ(s.materials.at(0).normal_texture, -1);
    EXPECT_EQ(s.materials.at(0).height_texture, 0);
    EXPECT_FLOAT_EQ(s.materials.at(0).bump_height_m, 20) << "0.02 km";
    EXPECT_NEAR(s.textures[0].rgb[0], 65535 * 128.0 / 255, 0.5);
}

TEST_F(BumpMap, HeightsWithoutAHeightAreToldAndNotUsed) {
    const Scene s = read("bump heights.png");
    EXPECT_TRUE(s.textures.empty());
    EXPECT_EQ(s.materials.at(0).height_texture, -1);
    ASSERT_EQ(s.warnings.size(), 1u);
    EXPECT_EQ(s.warnings[0],
              (folder_ / "heights.png") + ": heights without a -bm that says how high they are, not used");
}

TEST_F(BumpMap, MissingPicturesAreTold) {
    const Scene s = read("Ke 1 1 1\nmap_Ke no.png\nbump gone.png\nnorm lost.png");
    const Material& m = s.materials.at(0);
    EXPECT_EQ((std::array{m.emission_texture, m.normal_texture, m.height_texture}), (std::array{-1, -1, -1}));
    EXPECT_EQ(m.emission, Rgb{});
    EXPECT_EQ(s.warnings.size(), 3u);
}

// One triangle, glTF 2.0: the buffer holds three positions, (0 0 0), (1 0 0), (0 1 0), and three texture
// coordinates that are their first two numbers.
std::string gltf(const std::string& material, const std::string& more = "") {
    return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
"materials": [)" +
           material + R"(], )" + more +
           R"("images": [{"uri": "colour.png"}, {"uri": "normals.png"}, {"uri": "glow.png"}],
"samplers": [{"wrapS": 33071, "wrapT": 33071}, {"wrapS": 10497, "wrapT": 10497}],
"textures": [{"source": 0, "sampler": 0}, {"source": 1, "sampler": 1}, {"source": 2}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
{"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
"bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteLength": 36, "byteStride": 12}],
"buffers": [{"byteLength": 36, "uri":
"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})";
}

MeshFile read_gltf(const std::string& text) {
    const MemoryFolder folder;
    Result<MeshFile> m = read_mesh(folder.write("m.gltf", text), 1);
    if (!m) {
        ADD_FAILURE() << m.error().text();
        return {};
    }
    return std::move(*m);
}

TEST(GltfMaterial, EveryTextureIsNamedWithItsWrapping) {
    const MeshFile m = read_gltf(gltf(
        R"({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.7},
"normalTexture": {"index": 1, "scale": 0.5}, "emissiveTexture": {"index": 2}, "emissiveFactor": [1, 0.5, 0]})"));
    const MeshMaterial& a = m.materials.at(m.mesh.face_material.at(0));
    EXPECT_EQ(a.material.kind, &kinds::ggx);
    EXPECT_EQ(a.material.diffuse, (Rgb{1, 1, 1}));
    EXPECT_EQ(a.material.roughness, 0.7f);
    EXPECT_EQ(a.material.emission, (Rgb{1, 0.5f, 0}));
    EXPECT_EQ(a.material.normal_scale, 0.5f);
    EXPECT_TRUE(a.colour.file.ends_with("/colour.png"));
    EXPECT_TRUE(a.normal.file.ends_with("/normals.png"));
    EXPECT_TRUE(a.emission.file.ends_with("/glow.png"));
    EXPECT_EQ(a.colour.wrap, Texture::Wrap::clamp);
    EXPECT_EQ(a.normal.wrap, Texture::Wrap::repeat);
    EXPECT_TRUE(m.warnings.empty()) << m.warnings[0];
}

TEST(GltfMaterial, DefaultsAreTheStandards) {
    const MeshFile m = read_gltf(gltf("{}"));
    const Material& a = m.materials.at(m.mesh.face_material.at(0)).material;
    EXPECT_EQ(a.kind, &kinds::ggx);
    EXPECT_EQ(a.diffuse, (Rgb{1, 1, 1}));
    EXPECT_EQ((std::array{a.metallic, a.roughness, a.ior}), (std::array{1.0f, 1.0f, 1.5f}));
    EXPECT_EQ(a.emission, Rgb{});
}

TEST(GltfMaterial, TransmissionIsGlass) {
    const auto with_transmission = [](const char* factor) {
        return read_gltf(
            gltf(std::string(R"({"extensions": {"KHR_materials_transmission": {"transmissionFactor": )") + factor +
                     R"(}, "KHR_materials_ior": {"ior": 1.33}}})",
                 R"("extensionsUsed": ["KHR_materials_transmission", "KHR_materials_ior"], )"));
    };
    const MeshFile glass = with_transmission("0.9"), tinted = with_transmission("0.25");
    EXPECT_EQ(glass.materials.at(0).material.kind, &kinds::dielectric);
    EXPECT_EQ(glass.materials.at(0).material.ior, 1.33f);
    EXPECT_TRUE(glass.warnings.empty());
    EXPECT_EQ(tinted.materials.at(0).material.kind, &kinds::ggx);
    EXPECT_EQ(tinted.materials.at(0).material.ior, 1.33f);
    ASSERT_EQ(tinted.warnings.size(), 1u);
    EXPECT_NE(tinted.warnings[0].find("transparent materials are drawn opaque"), std::string::npos);
}

TEST(GltfMaterial, WhatIsPassedOverIsToldOnce) {
    const std::string both =
        R"({"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}, "baseColorTexture": {"index": 0}},
"normalTexture": {"index": 1, "texCoord": 1}})";
    const MeshFile m = read_gltf(gltf(both + ", " + both));
    ASSERT_EQ(m.warnings.size(), 2u);
    EXPECT_NE(m.warnings[0].find("metallic-roughness textures are not used, their factors are"), std::string::npos);
    EXPECT_NE(m.warnings[1].find("second texture coordinates"), std::string::npos);
    EXPECT_FALSE(m.materials.at(0).normal.named());
}

}  // namespace
}  // namespace narpa
