/// Materials and lights of scene files: each kind takes its own keys and no others.
#include <gtest/gtest.h>

#include <array>

#include "renderer/material/bsdf_kind.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/image_files.h"

namespace narpa {
namespace {

using test::BadFile;
using test::data_file;
using test::MemoryFolder;

#undef BALL
#define BALL "[[body]]\nname = \"x\"\nsphere = {radius_m = 1}\n"
#define LIGHT "[[light]]\nname = \"l\"\n"
#define PATH "[render]\nmethod = \"path\"\n"
constexpr const char* kRest =
    "\n[ambient]\nradiance = 1\n[[camera]]\nname = \"c\"\nresolution = [64, 48]\nfov_diagonal_deg = 30\n";

const BadFile kBadMaterials[] = {
    {"KindUnknown", BALL "material = {kind = \"chrome\"}\n", 4, 20,
     "expected one of \"lambert\", \"phong\", \"phong_classic\", \"mirror\", \"dielectric\", \"ggx\""},
    {"KindUnknownIsToldBeforeItsKeys", BALL "material = {roughness = 0.1, kind = \"chrome\"}\n", 4, 37,
     "\"chrome\""},
    {"AlbedoOverOne", BALL "material = {albedo = 1.2}\n", 4, 22, "albedo: got 1.2, expected a number in [0, 1]"},
    {"PhongGainsEnergy", BALL "material = {kind = \"phong\", albedo = 0.7, specular = 0.4, exponent = 9}\n", 4, 54,
     "specular: this surface sends back up to 1.1 times the light that falls on it"},
    {"PhongWithoutExponent", BALL "material = {kind = \"phong\", specular = 0.4}\n", 4, 12, "has no \"exponent\""},
    {"ClassicWithoutSpecular", BALL "material = {kind = \"phong_classic\", exponent = 4}\n", 4, 12,
     "has no \"specular\", expected a number or [r, g, b] in [0, 1], as the kind is \"phong_classic\""},
    {"ClassicOnPaths", PATH BALL "material = {kind = \"phong_classic\", specular = 0.4, exponent = 4}\n", 6, 20,
     "keeps no energy, expected \"phong\" where method = \"path\""},
    {"LambertWithSpecular", BALL "material = {specular = 0.4}\n", 4, 24,
     "specular: belongs to kind = \"phong\" or \"phong_classic\", and this is \"lambert\""},
    {"MirrorWithAlbedo", BALL "material = {kind = \"mirror\", albedo = 0.5}\n", 4, 39, "and this is \"mirror\""},
    {"MirrorWithTexture", BALL "material = {kind = \"mirror\", texture = \"a.png\"}\n", 4, 40,
     "and this is \"mirror\""},
    {"MirrorOverOne", BALL "material = {kind = \"mirror\", reflectance = 2}\n", 4, 44, "got 2"},
    {"GlassIor", BALL "material = {kind = \"dielectric\", ior = 0}\n", 4, 40, "expected a number in [0.1, 10]"},
    {"GlassFresnel", BALL "material = {kind = \"dielectric\", fresnel = \"none\"}\n", 4, 44,
     "expected one of \"exact\", \"schlick\""},
    {"GlassWithMetallic", BALL "material = {kind = \"dielectric\", metallic = 1}\n", 4, 45,
     "belongs to kind = \"ggx\", and this is \"dielectric\""},
    {"MapLatitudeUnknown", BALL "material = {texture = \"a.png\", map_latitude = \"geodetic\"}\n", 4, 47,
     "expected one of \"planetographic\", \"planetocentric\", \"parametric\""},
    {"MapLatitudeWithoutMap", BALL "material = {map_latitude = \"parametric\"}\n", 4, 28,
     "belongs to a texture, which is not here"},
    {"MapLatitudeOfAMesh",
     "[[body]]\nname = \"x\"\nmesh = \"a.obj\"\nmaterial = {texture = \"a.png\", map_latitude = \"parametric\"}\n",
     4, 47, "belongs to a sphere or an ellipsoid"},
    {"GgxIor", BALL "material = {kind = \"ggx\", ior = 0.9}\n", 4, 33, "expected a number in [1, 3]"},
    {"GgxRoughness", BALL "material = {kind = \"ggx\", roughness = -0.1}\n", 4, 39, "expected a number in [0, 1]"},
    {"GgxRough", BALL "material = {kind = \"ggx\", rough = 0.1}\n", 4, 27, "unknown key \"rough\" in material"},
    {"Asymmetry", BALL "material = {kind = \"lommel_seeliger\", asymmetry = 1}\n", 4, 51, "got 1"},
    {"LunarGainsEnergy", BALL "material = {kind = \"lunar_lambert\", albedo = [0.1, 0.6, 0.1]}\n", 4, 46,
     "albedo: this surface sends back up to 1.02 times the light that falls on it, in band 1"},
    {"HapkeGainsEnergy", BALL "material = {kind = \"hapke\", albedo = 1, opposition_b0 = 10, opposition_h = 10}\n",
     4, 38, "expected at most 1"},
    {"HapkeForward", BALL "material = {kind = \"hapke\", c = -2}\n", 4, 33,
     "c: got -2, expected a number in [-1, 1]"},
    {"HapkeSlope", BALL "material = {kind = \"hapke\", roughness_deg = 61}\n", 4, 45, "in [0, 60]"},
    {"HapkeSlopeOnAnother", BALL "material = {kind = \"ggx\", roughness_deg = 6}\n", 4, 43, "kind = \"hapke\""},
    {"EmissionInfinite", BALL "material = {emission = inf}\n", 4, 24, "emission: got inf"},
    {"GlowWithoutEmission", BALL "material = {emission_texture = \"a.png\"}\n", 4, 32,
     "multiplies the \"emission\""},
    {"CloudAlbedoAlone", BALL "material = {cloud_albedo = 0.5}\n", 4, 28,
     "belongs to cloud_texture, which is not here"},
    {"SpecularMapOnLambert", BALL "material = {specular_texture = \"a.png\"}\n", 4, 32,
     "belongs to kind = \"phong\" or \"phong_classic\", and this is \"lambert\""},
    {"CloudsOnGgx", BALL "material = {kind = \"ggx\", cloud_texture = \"a.png\"}\n", 4, 43,
     "belongs to kind = \"lambert\" or \"phong\", and this is \"ggx\""},
    {"NormalScaleAlone", BALL "material = {normal_scale = 2}\n", 4, 28,
     "belongs to normal_texture, which is not here"},
    {"BumpHeightAlone", BALL "material = {bump_height_m = 2}\n", 4, 29, "belongs to height_texture"},
    {"BumpWithoutHeight", BALL "material = {height_texture = \"a.png\"}\n", 4, 12, "has no \"bump_height_m\""},
    {"TextureOfANumber", BALL "material = {texture = 3}\n", 4, 23, "expected \"FILE\" or {file = \"FILE\", ...}"},
    {"TextureTableWithoutFile", BALL "material = {texture = {wrap = \"clamp\"}}\n", 4, 23,
     "texture has no \"file\""},
    {"TextureWrap", BALL "material = {texture = {file = \"a.png\", wrap = \"mirror\"}}\n", 4, 47,
     "expected one of \"repeat\", \"clamp\""},
    {"TextureColour", BALL "material = {texture = {file = \"a.png\", colour = \"rec709\"}}\n", 4, 49,
     "expected one of \"srgb\", \"linear\""},
    {"TextureKey", BALL "material = {texture = {file = \"a.png\", color = \"srgb\"}}\n", 4, 40,
     "unknown key \"color\" in texture; did you mean \"colour\"?"},
    {"NormalsAreNoColours", BALL "material = {normal_texture = {file = \"a.png\", colour = \"srgb\"}}\n", 4, 56,
     "holds data, which is linear"},
    {"HeightMissing", BALL "material = {bump_height_m = 1, height_texture = \"no.png\"}\n", 4, 49,
     "height_texture: "},

    {"LightWithoutKind", LIGHT "intensity_w_sr = 1\n", 1, 1,
     "[[light]] has no \"kind\", expected one of \"point\""},
    {"LightKind", LIGHT "kind = \"spot\"\n", 3, 8,
     "expected one of \"point\", \"directional\", \"rectangle\", \"disc\""},
    {"LightWithoutName", "[[light]]\nkind = \"point\"\nintensity_w_sr = 1\n", 1, 1, "[[light]] has no \"name\""},
    {"LightNameTwice",
     LIGHT "kind = \"point\"\nintensity_w_sr = 1\n" LIGHT "kind = \"point\"\nintensity_w_sr = 1\n", 6, 8,
     "\"l\" is the name of another [[light]]"},
    {"LightWithoutIntensity", LIGHT "kind = \"point\"\n", 1, 1, "has no \"intensity_w_sr\""},
    {"LightDark", LIGHT "kind = \"point\"\nintensity_w_sr = [0, 0, 0]\n", 4, 18,
     "got 0, expected a light that shines"},
    {"LightNegative", LIGHT "kind = \"point\"\nintensity_w_sr = -1\n", 4, 18, "got -1, expected a number in [0"},
    {"PointWithRadiance", LIGHT "kind = \"point\"\nintensity_w_sr = 1\nradiance_w_m2_sr = 1\n", 5, 20,
     "belongs to kind = \"rectangle\" or \"disc\", and this is \"point\""},
    {"PointThatLooks", LIGHT "kind = \"point\"\nintensity_w_sr = 1\nlook_at = [1, 0, 0]\n", 5, 11,
     "and this is \"point\""},
    {"DirectionalWithSize", LIGHT "kind = \"directional\"\nirradiance_w_m2 = 1\nradius_m = 1\n", 5, 12,
     "belongs to kind = \"disc\""},
    {"DirectionalWithPosition", LIGHT "kind = \"directional\"\nirradiance_w_m2 = 1\nposition_m = [0, 0, 1]\n", 5,
     14, "shines from infinitely far"},
    {"RectangleWithoutSize", LIGHT "kind = \"rectangle\"\nradiance_w_m2_sr = 1\n", 1, 1, "has no \"size_m\""},
    {"RectangleFlat", LIGHT "kind = \"rectangle\"\nradiance_w_m2_sr = 1\nsize_m = [1, 0]\n", 5, 14,
     "size_m[1]: got 0, expected a number in (0"},
    {"RectangleOfThree", LIGHT "kind = \"rectangle\"\nradiance_w_m2_sr = 1\nsize_m = [1, 1, 1]\n", 5, 10,
     "got an array of 3, expected an array of 2 numbers"},
    {"DiscWithoutRadius", LIGHT "kind = \"disc\"\nradiance_w_m2_sr = 1\n", 1, 1, "has no \"radius_m\""},
    {"DiscWithSize", LIGHT "kind = \"disc\"\nradiance_w_m2_sr = 1\nradius_m = 1\nsize_m = [1, 1]\n", 6, 10,
     "belongs to kind = \"rectangle\", and this is \"disc\""},
    {"LightMountUnknown", LIGHT "kind = \"point\"\nintensity_w_sr = 1\nmount = \"ship\"\n", 5, 9,
     "there is no body \"ship\""},
    {"LightLooksAtItself", LIGHT "kind = \"disc\"\nradiance_w_m2_sr = 1\nradius_m = 1\nlook_at = [0, 0, 0]\n", 6,
     11, "expected another point"},
    {"LightPower", LIGHT "kind = \"point\"\npower_w = 1\n", 4, 1, "unknown key \"power_w\" in [[light]]"},
};

class BadMaterialOrLight : public testing::TestWithParam<BadFile> {};

TEST_P(BadMaterialOrLight, SaysWhereAndWhat) {
    const BadFile& bad = GetParam();
    const MemoryFolder folder;
    std::string text = std::string(bad.text) + kRest;
    if (text.find("[[body]]") == text.npos) text += BALL;
    const std::string path = folder.write("bad.toml", text);
    const Result<Scene> scene = read_scene(path);
    ASSERT_FALSE(scene) << text;
    expect_error_of(bad, path, scene.error());
}
INSTANTIATE_TEST_SUITE_P(Scene, BadMaterialOrLight, testing::ValuesIn(kBadMaterials),
                         [](const auto& one) { return std::string(one.param.name); });

Scene read_good(const MemoryFolder& folder, const std::string& text) {
    Result<Scene> scene = read_scene(folder.write("s.toml", text + kRest));
    if (!scene) {
        ADD_FAILURE() << scene.error().text();
        return {};
    }
    return std::move(*scene);
}

Material read_material(const std::string& keys) {
    const MemoryFolder folder;
    const Scene s = read_good(folder, BALL "material = {" + keys + "}\n");
    return s.materials.empty() ? Material{} : s.materials[0];
}

TEST(SceneMaterial, EveryKindTakesItsKeys) {
    EXPECT_EQ(read_material("").kind, &kinds::lambert);
    const Material classic = read_material(
        "kind = \"phong_classic\", albedo = 0.9, specular = 0.8, exponent = 3, ambient = [0.1, 0.2, 0.3]");
    EXPECT_EQ(classic.kind, &kinds::phong_classic);
    EXPECT_EQ(classic.diffuse.x + classic.specular.x, 1.7f) << "this form's sum is not bounded";
    EXPECT_EQ(classic.ambient, (Rgb{0.1f, 0.2f, 0.3f}));
    EXPECT_EQ(classic.exponent, 3);
    const Material mirror = read_material("kind = \"mirror\", reflectance = [0.9, 0.8, 0.7]");
    EXPECT_EQ(mirror.kind, &kinds::mirror);
    EXPECT_EQ(mirror.specular, (Rgb{0.9f, 0.8f, 0.7f}));
    EXPECT_EQ(read_material("kind = \"mirror\"").specular, (Rgb{1, 1, 1}));
    const Material glass = read_material("kind = \"dielectric\", ior = 1.33, fresnel = \"schlick\"");
    EXPECT_EQ(glass.kind, &kinds::dielectric);
    EXPECT_EQ(glass.ior, 1.33f);
    EXPECT_TRUE(glass.schlick);
    EXPECT_FALSE(read_material("kind = \"dielectric\"").schlick);
    const Material foil =
        read_material("kind = \"ggx\", albedo = [0.9, 0.7, 0.3], metallic = 1, roughness = 0.2, ior = 1.6");
    EXPECT_EQ(foil.kind, &kinds::ggx);
    EXPECT_EQ(foil.diffuse, (Rgb{0.9f, 0.7f, 0.3f}));
    EXPECT_EQ((std::array{foil.metallic, foil.roughness, foil.ior}), (std::array{1.0f, 0.2f, 1.6f}));
    const Material regolith = read_material("kind = \"lommel_seeliger\", albedo = 0.1, asymmetry = -0.3");
    EXPECT_EQ(regolith.kind, &kinds::lommel_seeliger);
    EXPECT_EQ(regolith.asymmetry, -0.3f);
    EXPECT_EQ(read_material("kind = \"lunar_lambert\", albedo = 0.12").kind, &kinds::lunar_lambert);
    const Material hapke = read_material(
        "kind = \"hapke\", albedo = 0.2, b = 0.3, c = 0.1, opposition_b0 = 0.9, opposition_h = 0.07, "
        "roughness_deg = 45");
    EXPECT_EQ(hapke.kind, &kinds::hapke);
    EXPECT_EQ(hapke.diffuse.x, 0.2f);
    EXPECT_EQ((std::array{hapke.hapke.phase_b, hapke.hapke.phase_c}), (std::array{0.3f, 0.1f}));
    EXPECT_EQ((std::array{hapke.hapke.opposition_b0, hapke.hapke.opposition_h}), (std::array{0.9f, 0.07f}));
    EXPECT_FLOAT_EQ(hapke.hapke.roughness_rad, 0.78539816f);
}

TEST(SceneMaterial, DefaultsAreTheStructs) {
    const Material given;
    for (const BsdfKind* kind : bsdf_kinds()) {
        const std::string_view name = kind->name;
        std::string keys = "kind = \"" + std::string(name) + "\"";
        if (kind == &kinds::phong || kind == &kinds::phong_classic) keys += ", specular = 0, exponent = 1";
        const Material m = read_material(keys);
        EXPECT_EQ(m.kind, kind) << name;
        EXPECT_EQ((std::array{m.roughness, m.metallic, m.ior, m.asymmetry, m.normal_scale, m.bump_height_m}),
                  (std::array{given.roughness, given.metallic, given.ior, given.asymmetry, given.normal_scale,
                              given.bump_height_m}));
        EXPECT_EQ(m.hapke.phase_b, given.hapke.phase_b);
        EXPECT_EQ(m.hapke.opposition_h, given.hapke.opposition_h);
        EXPECT_EQ((std::array{m.texture, m.emission_texture, m.normal_texture, m.height_texture}),
                  (std::array{-1, -1, -1, -1}));
    }
}

TEST(SceneMaterial, EveryTextureIsReadForWhatItIs) {
    const MemoryFolder folder;
    test::write_image_file(folder / "grey.png", cv::Mat(2, 2, CV_8UC3, cv::Scalar(128, 128, 128)));
    const Scene s = read_good(
        folder, BALL
        "[body.material]\nemission = 2\ntexture = \"grey.png\"\n"
        "emission_texture = {file = \"grey.png\", wrap = \"clamp\", colour = \"linear\"}\n"
        "normal_texture = \"grey.png\"\nnormal_scale = 2\nheight_texture = \"grey.png\"\nbump_height_m = -0.25\n");
    ASSERT_EQ(s.textures.size(), 4u) << "one file, four uses of it";
    const Material& m = s.materials.at(0);
    const auto texture = [&s](int index) { return s.textures.at(static_cast<std::size_t>(index)); };
    EXPECT_NEAR(texture(m.texture).rgb[0], 65535 * 0.2158605, 0.5) << "sRGB 128 is 0.2158605 in linear light";
    EXPECT_NEAR(texture(m.emission_texture).rgb[0], 65535 * 128.0 / 255, 0.5);
    EXPECT_NEAR(texture(m.normal_texture).rgb[0], 65535 * 0.5, 0.5) << "128 is the middle of a normal map";
    EXPECT_NEAR(texture(m.height_texture).rgb[0], 65535 * 128.0 / 255, 0.5);
    EXPECT_EQ(texture(m.texture).wrap, Texture::Wrap::repeat);
    EXPECT_EQ(texture(m.emission_texture).wrap, Texture::Wrap::clamp);
    EXPECT_EQ(m.normal_scale, 2);
    EXPECT_EQ(m.bump_height_m, -0.25f);
}

TEST(SceneMaterial, MapsOfAPlanetAreLinear) {
    const MemoryFolder folder;
    test::write_image_file(folder / "grey.png", cv::Mat(2, 2, CV_8UC3, cv::Scalar(128, 128, 128)));
    const Scene s = read_good(folder, BALL
                              "[body.material]\nkind = \"phong\"\nspecular = 0.1\nexponent = 9\n"
                              "specular_texture = \"grey.png\"\ncloud_texture = \"grey.png\"\n");
    const Material& m = s.materials.at(0);
    for (const int texture : {m.specular_texture, m.cloud_texture})
        EXPECT_NEAR(s.textures.at(static_cast<std::size_t>(texture)).rgb[0], 65535 * 128.0 / 255, 0.5);
    EXPECT_EQ(m.cloud_albedo, (Rgb{0.75f, 0.75f, 0.75f}));
    EXPECT_EQ(m.emission_texture, -1);
}

TEST(SceneMaterial, FilesAreReadOnceForEachUse) {
    const MemoryFolder folder;
    folder.write("t.ppm", "P3 1 1 255\n9 9 9\n");
    std::string text;
    for (int i = 0; i < 3; ++i)
        text += "[[body]]\nsphere = {radius_m = 1}\nname = \"b" + std::to_string(i) +
                "\"\nmaterial = {texture = \"" + (i == 1 ? "./t.ppm" : "t.ppm") +
                "\", normal_texture = \"t.ppm\"}\n";
    const Scene s = read_good(folder, text);
    EXPECT_EQ(s.textures.size(), 2u);
    EXPECT_EQ(s.materials.at(0).texture, s.materials.at(2).texture);
    EXPECT_EQ(s.materials.at(1).normal_texture, s.materials.at(2).normal_texture);
    EXPECT_NE(s.materials.at(1).texture, s.materials.at(1).normal_texture);
}

TEST(SceneMaterial, EveryTextureNeedsCoordinatesOfTheMesh) {
    const MemoryFolder folder;
    folder.write("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("t.ppm", "P3 1 1 255\n9 9 9\n");
    for (const char* keys :
         {"texture", "emission = 1, emission_texture", "normal_texture", "bump_height_m = 1, height_texture"}) {
        const std::string key = std::string(keys).substr(std::string(keys).rfind(' ') + 1);
        const Result<Scene> scene =
            read_scene(folder.write("s.toml", "[[body]]\nname = \"x\"\nmesh = \"t.obj\"\nmaterial = {" +
                                                  std::string(keys) + " = \"t.ppm\"}\n" + kRest));
        ASSERT_FALSE(scene) << keys;
        EXPECT_EQ(scene.error().line, 4) << scene.error().text();
        EXPECT_EQ(scene.error().what.find(key + ": "), 0u) << scene.error().what;
        EXPECT_NE(scene.error().what.find("t.obj has no texture coordinates"), std::string::npos);
    }
}

TEST(SceneMaterial, MirrorsAndGlassInDirectLightAreTold) {
    const MemoryFolder folder;
    const std::string bodies = BALL
        "material = {kind = \"mirror\"}\n[[body]]\nname = \"pane\"\nsphere = {radius_m = 1}\n"
        "material = {kind = \"dielectric\"}\n";
    const Scene direct = read_good(folder, bodies), path = read_good(folder, PATH + bodies);
    ASSERT_EQ(direct.warnings.size(), 1u);
    EXPECT_EQ(
        direct.warnings[0],
        "black in direct light: \"x\" (mirror), \"pane\" (dielectric); method = \"path\" in [render] shows them");
    EXPECT_TRUE(path.warnings.empty());
}

TEST(SceneMaterial, ExampleHoldsEveryKindThatPathsHave) {
    const Result<Scene> s = read_scene(data_file("complete.toml"));
    ASSERT_TRUE(s) << s.error().text();
    for (const BsdfKind* kind : bsdf_kinds()) {
        if (kind == &kinds::phong_classic) continue;  // direct light's alone
        EXPECT_TRUE(std::any_of(s->materials.begin(), s->materials.end(), [kind](const Material& m) {
            return m.kind == kind;
        })) << kind->name;
    }
}

}  // namespace
}  // namespace narpa
