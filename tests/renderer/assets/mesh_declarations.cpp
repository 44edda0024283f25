// What mesh files declare is used, or named in a warning or an error. The files are written here value by value, so
// the right values are known. The tables of docs/meshes.md, row by row.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/expect_has.h"
#include "tests/support/gltf_document.h"
#include "tests/support/srgb.h"

namespace narpa {
namespace {

using namespace test;
using nlohmann::json;

/// What became of a file: its mesh, its warnings, or its error.
struct MeshReading {
    MeshFile file;
    std::string warnings, error;

    MeshReading(const std::string& name, const std::string& bytes, double crease_rad = 0) {
        const MemoryFolder folder;
        read(folder.write(name, bytes), crease_rad);
    }
    explicit MeshReading(const GltfDocument& document) : MeshReading("m.gltf", document.text()) {}
    void read(const std::string& path, double crease_rad = 0) {
        Result<MeshFile> m = read_mesh(path, 1, crease_rad);
        if (!m) return void(error = m.error().text());
        file = std::move(*m);
        for (const std::string& w : file.warnings) warnings += w + "\n";
    }
    [[nodiscard]] const Material& material(std::size_t face = 0) const {
        return file.materials.at(file.mesh.face_material.at(face)).material;
    }
    [[nodiscard]] Vec3f corner(std::size_t face, std::size_t k) const {
        return file.mesh.positions.at(file.mesh.faces.at(face).at(k));
    }
    /// Albedo at a corner.
    [[nodiscard]] Rgb albedo(std::size_t face, std::size_t k) const {
        const Material& m = material(face);
        return m.vertex_colours >= 0 ? m.diffuse * file.mesh.colours.at(file.mesh.faces.at(face).at(k)) : m.diffuse;
    }
    [[nodiscard]] double area() const {
        Vec3 sum;
        for (std::size_t f = 0; f < file.mesh.faces.size(); ++f)
            sum += 0.5 * cross(vec_cast<double>(corner(f, 1) - corner(f, 0)),
                               vec_cast<double>(corner(f, 2) - corner(f, 0)));
        return norm(sum);
    }
};

void expect_near(const Rgb& a, const Rgb& b) {
    EXPECT_NEAR(a.x, b.x, 1e-6f);
    EXPECT_NEAR(a.y, b.y, 1e-6f);
    EXPECT_NEAR(a.z, b.z, 1e-6f);
}

TEST(GltfDeclarations, RequiredExtensionsAreKnownOrRefused) {
    for (const char* name : {"VENDOR_something", "KHR_materials_unlit", "EXT_meshopt_compression"})
        EXPECT_HAS(MeshReading(gltf_triangle({}, {{"extensionsRequired", {name}}})).error,
                   fmt::format("the file requires the glTF extension {}, which is not read", name));
    for (const char* name : {"KHR_mesh_quantization", "KHR_draco_mesh_compression", "KHR_texture_transform",
                             "KHR_texture_basisu", "EXT_texture_webp"}) {
        const MeshReading r(gltf_triangle({}, {{"extensionsRequired", {name}}, {"extensionsUsed", {name}}}));
        EXPECT_EQ(r.error + r.warnings, "") << name;
    }
    const MeshReading used(gltf_triangle(
        {{"material", 0}}, {{"extensionsUsed", {"VENDOR_a"}},
                            {"materials", {{{"extensions", {{"KHR_materials_unlit", json::object()}}}}}}}));
    EXPECT_HAS(used.warnings, "glTF extensions that are not used: KHR_materials_unlit, VENDOR_a");
}

TEST(GltfDeclarations, VersionsAndContainersAreChecked) {
    EXPECT_HAS(MeshReading(gltf_triangle({}, {{"asset", {{"version", "3.0"}}}})).error, "glTF of version 3.0");
    EXPECT_HAS(MeshReading(gltf_triangle({}, {{"asset", {{"minVersion", "2.1"}}}})).error, "at least 2.1");
    const std::string glb = gltf_triangle().binary();
    EXPECT_EQ(MeshReading("m.glb", glb).error, "");
    EXPECT_HAS(MeshReading("m.glb", glb.substr(0, glb.size() - 8)).error, "cut short");
    EXPECT_HAS(MeshReading("m.gltf", "{}").error, "no \"asset\" in it");
    EXPECT_HAS(MeshReading("m.gltf", "ply").error, "expected a glTF document");
    EXPECT_HAS(MeshReading("m.gltf", "{\"asset\"").error, "parse error at line 1");
}

TEST(GltfDeclarations, UrisAreDecoded) {
    const MemoryFolder folder;
    const GltfDocument d = gltf_triangle();
    folder.write("my part.bin", d.buffer);
    folder.write("as%20written.bin", d.buffer);
    for (const char* uri : {"my%20part.bin", "my part.bin", "as%20written.bin"}) {
        MeshReading r("none.gltf", "");
        r.error.clear();
        r.read(folder.write("m.gltf", d.with_uri(uri)));
        EXPECT_EQ(r.error, "") << uri;
        EXPECT_EQ(r.file.mesh.faces.size(), 1u);
    }
    EXPECT_HAS(MeshReading("m.gltf", d.with_uri("no.bin")).error, "no.bin\" cannot be opened");
    EXPECT_HAS(MeshReading("m.gltf", d.with_uri("data:;base64,AAAA")).error, "buffer 0 has 3 bytes, expected 36");
    EXPECT_HAS(MeshReading("m.gltf", d.with_uri("data:;base64,?")).error, "a data URI is not Base64");
}

TEST(GltfDeclarations, StripsAndFansAreTriangles) {
    GltfDocument d = gltf_triangle();
    auto& primitive = d.root["meshes"][0]["primitives"][0];
    primitive["attributes"]["POSITION"] = d.add({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0});
    primitive["mode"] = 5;
    const MeshReading strip(d);
    ASSERT_EQ(strip.file.mesh.faces.size(), 2u) << strip.error;
    EXPECT_NEAR(strip.area(), 1, 1e-6) << "both face the same side";
    primitive["mode"] = 6;
    primitive["indices"] = d.add({0, 1, 3, 2}, {.type = "SCALAR", .component = 5121});
    EXPECT_NEAR(MeshReading(d).area(), 1, 1e-6);
    primitive["mode"] = 1;
    d.root["meshes"][0]["primitives"].push_back(gltf_triangle().root["meshes"][0]["primitives"][0]);
    EXPECT_HAS(MeshReading(d).warnings, "1 primitives of points or lines are not used");
}

TEST(GltfDeclarations, IndicesOutOfRangeAreRefused) {
    GltfDocument d = gltf_triangle();
    d.root["meshes"][0]["primitives"][0]["indices"] = d.add({0, 1, 9}, {.type = "SCALAR", .component = 5123});
    EXPECT_HAS(MeshReading(d).error, "a primitive has index 9, counted from 0, of 3 vertices");
    const auto broken = [](const char* key, const json& value) {
        GltfDocument other = gltf_triangle();
        other.root["accessors"][0][key] = value;
        return MeshReading(other).error;
    };
    EXPECT_HAS(broken("count", 4), "of 4 elements reach beyond its buffer view of 36 bytes");
    EXPECT_HAS(broken("count", 1e12), "reach beyond its buffer view");
    EXPECT_HAS(broken("byteOffset", 4), "reach beyond its buffer view");
    EXPECT_HAS(broken("componentType", 5130), "components of type 5130");
    EXPECT_HAS(broken("type", "VEC2"), "has the type \"VEC2\", expected VEC3");
    EXPECT_HAS(broken("bufferView", 7), "\"bufferViews\" 7 is used, counted from 0; the file has 1");
    EXPECT_HAS(broken("count", "three"), "\"count\" is string, expected a number");
    EXPECT_HAS(MeshReading(gltf_triangle({{"material", 2}})).error, "\"materials\" 2 is used");
    EXPECT_HAS(MeshReading(gltf_triangle({}, {{"nodes", {{{"mesh", 0}, {"children", {0}}}}}})).error, "node 0");
}

TEST(GltfDeclarations, InstancesSkinsAndMorphTargetsAreUsed) {
    GltfDocument d = gltf_triangle();
    d.root["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
        {"TRANSLATION", d.add({0, 0, 0, 5, 0, 0, 0, 5, 0})},
        {"SCALE", d.add({1, 1, 1, 2, 2, 2, 1, 1, 1})},
        {"ROTATION", d.add({0, 0, 0, 127, 0, 0, 90, 90, 0, 0, 127, 0},
                           {.type = "VEC4", .component = 5120, .is_normalised = true})}};
    const MeshReading instances(d);
    ASSERT_EQ(instances.file.mesh.faces.size(), 3u) << instances.error;
    EXPECT_EQ(instances.corner(1, 0), (Vec3f{5, 0, 0}));
    EXPECT_NEAR(instances.corner(1, 1).y, 2, 1e-6) << "turned by 90 degrees about z";
    EXPECT_NEAR(instances.corner(2, 1).x, -1, 1e-6) << "turned by 180 degrees about z";

    GltfDocument skin = gltf_triangle();
    auto& attributes = skin.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = skin.add({0, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0}, {.type = "VEC4", .component = 5121});
    attributes["WEIGHTS_0"] = skin.add({128, 127, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0},
                                       {.type = "VEC4", .component = 5121, .is_normalised = true});
    skin.root["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"translation", {9, 9, 9}}},
                          {{"translation", {0, 0, 3}}},
                          {{"translation", {0, 0, 5}}}};
    skin.root["scenes"][0]["nodes"] = {0, 1, 2};
    skin.root["skins"] = {{{"joints", {1, 2}}}};  // no matrices: they are the identity
    const MeshReading skinned(skin);
    ASSERT_EQ(skinned.file.mesh.faces.size(), 1u) << skinned.error;
    EXPECT_NEAR(skinned.corner(0, 0).z, (128 * 3 + 127 * 5) / 255.0, 1e-5);
    EXPECT_EQ(skinned.corner(0, 1), (Vec3f{1, 0, 3})) << "the node's own place does not count";
    EXPECT_EQ(skinned.corner(0, 2), (Vec3f{0, 1, 5}));
    skin.root["skins"][0]["joints"] = {1};
    EXPECT_HAS(MeshReading(skin).error, "a vertex has joint 1 of 1");

    GltfDocument morph = gltf_triangle();
    morph.root["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", morph.add({0, 0, 2, 0, 0, 2, 0, 0, 2})}}};
    EXPECT_EQ(MeshReading(morph).corner(0, 0).z, 0);
    morph.root["meshes"][0]["weights"] = {0.5};
    EXPECT_EQ(MeshReading(morph).corner(0, 0).z, 1);
    morph.root["nodes"][0]["weights"] = {0.25};
    EXPECT_EQ(MeshReading(morph).corner(0, 0).z, 0.5);
}

TEST(GltfDeclarations, WhatIsNotDrawnIsNamed) {
    EXPECT_HAS(MeshReading(gltf_triangle({}, {{"animations", {json::object()}}})).warnings,
               "animations are not used");
    EXPECT_HAS(MeshReading(gltf_triangle({}, {{"scenes", {{{"nodes", {0}}}, {{"nodes", {0}}}}}})).warnings,
               "of its 2 scenes only scene 0 is used");
    const auto warnings_of = [](const json& material, const json& document = {}) {
        json all = {{"materials", {material}}};
        if (!document.is_null()) all.merge_patch(document);
        return MeshReading(gltf_triangle({{"material", 0}}, all)).warnings;
    };
    EXPECT_HAS(warnings_of({{"alphaMode", "BLEND"}}), "transparent materials are drawn opaque");
    EXPECT_EQ(warnings_of({{"alphaMode", "OPAQUE"}, {"doubleSided", true}}), "");
    EXPECT_HAS(warnings_of({{"occlusionTexture", {{"index", 0}}}}), "occlusion textures are not used");
    const json basis = {{"textures", {{{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}}}},
                        {"images", {{{"uri", "t.ktx2"}}}}},
               colour = {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}};
    EXPECT_HAS(warnings_of(colour, basis), "its textures (KHR_texture_basisu) cannot be read and are not used");
    const MeshReading lost(gltf_triangle({{"material", 0}}, [&] {
        json all = basis;
        all["materials"] = json::array({colour});
        return all;
    }()));
    EXPECT_EQ(lost.material().diffuse, (Rgb{0.5f, 0.5f, 0.5f}));
}

TEST(GltfDeclarations, MaterialExtensionsAreUsed) {
    const auto material = [](const json& m) {
        return MeshReading(gltf_triangle({{"material", 0}}, {{"materials", {m}}})).material();
    };
    const json strong = {{"emissiveFactor", {1, 0.5, 0}},
                         {"extensions", {{"KHR_materials_emissive_strength", {{"emissiveStrength", 20}}}}}};
    EXPECT_EQ(material(strong).emission, (Rgb{20, 10, 0}));
    const auto glossy = [&](const json& extension) {
        return material({{"extensions", {{"KHR_materials_pbrSpecularGlossiness", extension}}}});
    };
    const Material plastic = glossy({{"diffuseFactor", {0.2, 0.3, 0.4, 1}},
                                     {"specularFactor", {0.04, 0.04, 0.04}},
                                     {"glossinessFactor", 0.25}});
    EXPECT_EQ(plastic.kind, &kinds::ggx);
    expect_near(plastic.diffuse, {0.2f, 0.3f, 0.4f});
    EXPECT_EQ(plastic.metallic, 0);
    EXPECT_EQ(plastic.roughness, 0.75f);
    EXPECT_NEAR(plastic.ior, 1.5, 1e-6);
    const Material metal = glossy({{"diffuseFactor", {0, 0, 0, 1}}, {"specularFactor", {0.9, 0.6, 0.3}}});
    EXPECT_NEAR(metal.metallic, 1, 1e-6);
    expect_near(metal.diffuse, {0.9f, 0.6f, 0.3f});
    EXPECT_NEAR(glossy({{"specularFactor", {0.01, 0.01, 0.01}}}).ior, 1.1 / 0.9, 1e-6);
    const MeshReading none(gltf_triangle());
    EXPECT_EQ(none.material().kind, &kinds::ggx) << "glTF's own default";
    EXPECT_EQ(none.material().metallic, 1);
}

TEST(GltfDeclarations, TextureCoordinatesOfTheMaterialAreUsed) {
    GltfDocument d =
        gltf_triangle({{"material", 0}}, {{"images", {{{"uri", "t.png"}}}}, {"textures", {{{"source", 0}}}}});
    auto& attributes = d.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["TEXCOORD_0"] =
        d.add({0, 0, 65535, 0, 0, 32768}, {.type = "VEC2", .component = 5123, .is_normalised = true});
    attributes["TEXCOORD_1"] = d.add({0.5, 0.5, 0.5, 0.25, 0.5, 0.5}, {.type = "VEC2"});
    json& texture = d.root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
    const auto uv = [&](std::size_t k) {
        const MeshReading r(d);
        return r.file.mesh.uvs.at(r.file.mesh.faces.at(0).at(k));
    };
    texture = {{"index", 0}};
    EXPECT_EQ(uv(1), (std::array{1.0f, 1.0f})) << "v points down in glTF";
    EXPECT_NEAR(uv(2)[1], 1 - 32768 / 65535.0, 1e-7);
    texture["texCoord"] = 1;
    EXPECT_EQ(uv(1), (std::array{0.5f, 0.75f}));
    texture["texCoord"] = 0;
    texture["extensions"]["KHR_texture_transform"] = {
        {"offset", {0.25, 0.5}}, {"scale", {0.5, 2}}, {"rotation", std::acos(0.0)}};
    EXPECT_NEAR(uv(1)[0], 0.25, 1e-6) << "counter-clockwise on the image: (1, 0) goes up";
    EXPECT_NEAR(uv(1)[1], 1 - (0.5 - 0.5), 1e-6);
    d.root["materials"][0]["normalTexture"] = {{"index", 0}};
    const MeshReading two(d);
    EXPECT_HAS(two.warnings, "textures with another KHR_texture_transform than the material's colour are not used");
    EXPECT_FALSE(two.file.materials.at(two.file.mesh.face_material[0]).normal.named());
}

TEST(MeshColours, VerticesMultiplyTheAlbedo) {
    GltfDocument d = gltf_triangle(
        {{"material", 0}}, {{"materials", {{{"pbrMetallicRoughness", {{"baseColorFactor", {0.5, 1, 1, 1}}}}}}}});
    auto& attributes = d.root["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = d.add({255, 0, 0, 255, 0, 51, 0, 9, 0, 0, 102, 0},
                                  {.type = "VEC4", .component = 5121, .is_normalised = true});
    const MeshReading gltf(d);
    expect_near(gltf.albedo(0, 0), {0.5f, 0, 0});
    expect_near(gltf.albedo(0, 1), {0, 0.2f, 0});
    expect_near(gltf.albedo(0, 2), {0, 0, 0.4f});
    EXPECT_EQ(gltf.warnings, "");
    d.root["accessors"].back().erase("normalized");
    EXPECT_HAS(MeshReading(d).warnings, "integers that are not \"normalized\"");
    expect_near(MeshReading(d).albedo(0, 1), {0, 0.2f, 0});

    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "property {0} red\nproperty {0} green\nproperty {0} blue\nproperty {0} alpha\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 {1} 0 0 0\n1 0 0 0 {1} 0 0\n0 1 0 0 0 {2} 0\n3 0 1 2\n";
    const auto of = [&](const char* type, const char* full, const char* half) {
        return MeshReading("m.ply", fmt::format(fmt::runtime(ply), type, full, half));
    };
    expect_near(of("uchar", "255", "128").albedo(0, 2), {0, 0, static_cast<float>(light_of(128 / 255.0))});
    expect_near(of("ushort", "65535", "32768").albedo(0, 2), {0, 0, 32768 / 65535.0f});
    expect_near(of("float", "1", "0.5").albedo(0, 2), {0, 0, 0.5f});
    expect_near(of("float", "255", "128").albedo(0, 2), {0, 0, static_cast<float>(light_of(128 / 255.0))});
    expect_near(of("uchar", "255", "128").albedo(0, 0), {1, 0, 0});

    const MeshReading obj("m.obj",
                          "v 0 0 0 1 0 0\nv 1 0 0 0 0.5 0\nv 0 1 0 0 0 1 0.5\nv 1 1 0\nf 1 2 3\nf 2 4 3\n");
    expect_near(obj.albedo(0, 1), {0, static_cast<float>(light_of(0.5)), 0});
    expect_near(obj.albedo(1, 0), {0.5f, 0.5f, 0.5f});
    EXPECT_HAS(obj.warnings, "1 triangle with colours at some corners only");
    expect_near(MeshReading("m.obj", "v 0 0 0 255 0 0\nv 1 0 0 0 128 0\nv 0 1 0 0 0 255\nf 1 2 3\n").albedo(0, 1),
                {0, static_cast<float>(light_of(128 / 255.0)), 0});
    EXPECT_EQ(MeshReading("m.obj", "v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").warnings, "") << "weights";
    EXPECT_HAS(MeshReading("m.obj", "v 0 0 0 1 2\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").warnings,
               "neither a weight nor a colour");
}

TEST(MeshColours, FacesHaveTheirs) {
    const MeshReading ply(
        "m.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_index\nproperty uchar red\nproperty uchar green\n"
        "property uchar blue\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n");
    expect_near(ply.albedo(0, 0), {1, 0, 0});
    expect_near(ply.albedo(1, 0), {0, 1, 0});
    const auto stl = [](const std::string& header, std::initializer_list<unsigned> attributes) {
        std::string out = header + std::string(80 - header.size(), ' ') + bytes_of(attributes.size(), 4, false);
        float x = 0;
        for (const unsigned attribute : attributes) {
            for (const float v : {0.0f, 0.0f, 1.0f, x, 0.0f, 0.0f, x + 1, 0.0f, 0.0f, x, 1.0f, 0.0f})
                out += bytes_of(std::bit_cast<std::uint32_t>(v), 4, false);
            out += bytes_of(attribute, 2, false);
            x += 2;
        }
        return MeshReading("m.stl", out);
    };
    const MeshReading viscam = stl("", {0x8000u | 31u << 10, 0x8000u | 16u, 0, 5});
    expect_near(viscam.albedo(0, 0), {1, 0, 0});
    expect_near(viscam.albedo(1, 0), {0, 0, static_cast<float>(light_of(16 / 31.0))});
    expect_near(viscam.albedo(2, 0), {0.5f, 0.5f, 0.5f});
    EXPECT_HAS(viscam.warnings, "attributes of 1 facets are no colours");
    const MeshReading magics = stl("made by X COLOR=\xff\x80\x01\xff MATERIAL=123456789012", {31u, 0x8000u});
    expect_near(magics.albedo(0, 0), {1, 0, 0});
    expect_near(magics.albedo(1, 0),
                {1, static_cast<float>(light_of(128 / 255.0)), static_cast<float>(light_of(1 / 255.0))});
    EXPECT_HAS(magics.warnings, "MATERIAL= of its header is not used");
}

TEST(MeshColours, AreDrawnAndReplacedByTheScenesMaterial) {
    const MemoryFolder folder;
    folder.write("m.obj", "v -1 -1 0 1 0 0\nv 1 -1 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n");
    const auto scene = [&](const std::string& material) {
        return read_scene(folder.write(
            "s.toml", "[sun]\ndirection = [0.0, 0.0, 1.0]\n[[body]]\nname = \"b\"\nmesh = \"m.obj\"\n" + material +
                          "[[camera]]\nname = \"c\"\nresolution = [8, 8]\nfov_diagonal_deg = 9\n"));
    };
    const auto own = scene(""), given = scene("material = {kind = \"lambert\", albedo = 0.3}\n");
    ASSERT_TRUE(own) << own.error().text();
    EXPECT_EQ(own->materials.at(own->meshes.at(0).face_material.at(0)).vertex_colours, 0);
    EXPECT_EQ(own->meshes.at(0).colours.size(), 3u);
    ASSERT_TRUE(given) << given.error().text();
    EXPECT_TRUE(given->meshes.at(0).colours.empty());
}

TEST(DefaultMaterial, IsGreyInFormatsWithoutOneOfTheirOwn) {
    const std::string
        facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n",
        ply =
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for (const auto& [name, text] :
         {std::pair<const char*, std::string>("m.stl", "solid s\n" + facet + "endsolid s\n"),
          {"m.ply", ply},
          {"m.tab", "3 1\n0 0 0\n1 0 0\n0 1 0\n1 2 3\n"},
          {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}}) {
        const MeshReading r(name, text);
        EXPECT_EQ(r.error + r.warnings, "") << name;
        EXPECT_EQ(r.material().kind, &kinds::lambert) << name;
        EXPECT_EQ(r.material().diffuse, (Rgb{0.5f, 0.5f, 0.5f})) << name;
    }
}

}  // namespace
}  // namespace narpa
