#include <fmt/format.h>

#include <array>

#include "base/constants.h"
#include "renderer/material/albedo.h"
#include "renderer/scene_file/kind_names.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

/// Thick clouds reflect 0.6 to 0.9 (K. N. Liou, An Introduction to Atmospheric Radiation, 2nd ed. 2002).
constexpr Rgb kCloudAlbedo{0.75f, 0.75f, 0.75f};
constexpr Range kRadiance{.low = 0, .high = 1e30};

/// Keys of each kind beside those that all have: emission, normals, heights.
const std::array<KindKeys, 9> kKindKeys{{
    {"lambert", {"albedo", "texture", "cloud_texture", "cloud_albedo"}},
    {"phong", {"albedo", "texture", "specular", "exponent", "specular_texture", "cloud_texture", "cloud_albedo"}},
    {"phong_classic", {"albedo", "texture", "specular", "exponent", "ambient", "specular_texture"}},
    {"mirror", {"reflectance"}},
    {"dielectric", {"ior", "fresnel"}},
    {"ggx", {"albedo", "texture", "metallic", "roughness", "ior", "fresnel"}},
    {"lommel_seeliger", {"albedo", "texture", "asymmetry"}},
    {"lunar_lambert", {"albedo", "texture"}},
    {"hapke", {"albedo", "texture", "b", "c", "opposition_b0", "opposition_h", "roughness_deg"}},
}};

/// Records a problem where the surface would reflect more than it receives.
void check_energy(TableReader& table, const Material& m) {
    using enum Material::Kind;
    if (m.kind != phong && m.kind != lunar_lambert && m.kind != hapke)
        return;                                              // the ranges of their keys ensure it
    const float rounding = m.kind == hapke ? 5e-3f : 1e-6f;  // of largest_albedo: by quadrature, or exact
    const Rgb most = largest_albedo(m);
    for (int b = 0; b < 3; ++b)
        if (!(most[b] <= 1 + rounding))
            return table.fail(
                m.kind == phong ? "specular" : "albedo",
                fmt::format("this surface sends back up to {:.3g} times the light that falls on it, in "
                            "band {}, expected at most 1",
                            most[b], b));
}

void read_specular(TableReader& table, Material& m) {
    const std::string_view kind = name_of(m.kind, kMaterialKinds);
    if (m.kind == Material::Kind::phong || m.kind == Material::Kind::phong_classic) {
        table.require("specular", fmt::format("a number or [r, g, b] in [0, 1], as the kind is \"{}\"", kind));
        table.require("exponent", fmt::format("a number in [0, 10000], as the kind is \"{}\"", kind));
    }
    m.specular = table.rgb("specular", kUnit).value_or(Rgb{});
    if (m.kind == Material::Kind::mirror) m.specular = table.rgb("reflectance", kUnit).value_or(Rgb{1, 1, 1});
    m.exponent = static_cast<float>(table.number("exponent", {.low = 0, .high = 1e4}).value_or(m.exponent));
    m.ambient = table.rgb("ambient", kUnit).value_or(m.ambient);
}

void read_fresnel(TableReader& table, Material& m) {
    static constexpr std::array<std::pair<std::string_view, bool>, 2> kFresnel{
        {{"exact", false}, {"schlick", true}}};
    constexpr Range kGlass{.low = 0.1, .high = 10}, kCoat{.low = 1, .high = 3};
    const bool glass = m.kind == Material::Kind::dielectric;
    m.ior = static_cast<float>(table.number("ior", glass ? kGlass : kCoat).value_or(m.ior));
    m.schlick = table.choice<bool>("fresnel", kFresnel).value_or(m.schlick);
    m.metallic = static_cast<float>(table.number("metallic", kUnit).value_or(m.metallic));
    m.roughness = static_cast<float>(table.number("roughness", kUnit).value_or(m.roughness));
}

void read_regolith(TableReader& table, Material& m) {
    const auto number = [&table](const char* key, const Range& range, float otherwise) {
        return static_cast<float>(table.number(key, range).value_or(otherwise));
    };
    m.asymmetry = number("asymmetry", {.low = -0.95, .high = 0.95}, m.asymmetry);
    m.hapke.phase_b = number("b", {.low = 0, .high = 0.95}, m.hapke.phase_b);
    m.hapke.phase_c = number("c", {.low = -1, .high = 1}, m.hapke.phase_c);
    m.hapke.opposition_b0 = number("opposition_b0", {.low = 0, .high = 10}, m.hapke.opposition_b0);
    m.hapke.opposition_h = number("opposition_h", {.low = 0, .high = 10, .low_open = true}, m.hapke.opposition_h);
    if (const auto degrees = table.number("roughness_deg", {.low = 0, .high = 60}))
        m.hapke.roughness_rad = static_cast<float>(*degrees * kPi / 180);
}

/// {file = "FILE", wrap = ..., colour = ...}; the last for colours only.
void read_texture_table(TableReader table, std::string& file, TextureUse& use) {
    using Wrap = Texture::Wrap;
    using Colour = TextureUse::Colour;
    static constexpr std::array<std::pair<std::string_view, Wrap>, 2> kWraps{
        {{"repeat", Wrap::repeat}, {"clamp", Wrap::clamp}}};
    static constexpr std::array<std::pair<std::string_view, Colour>, 2> kColours{
        {{"srgb", Colour::srgb}, {"linear", Colour::linear}}};
    table.require("file", "the name of an image file");
    file = table.text("file").value_or("");
    use.wrap = table.choice<Wrap>("wrap", kWraps).value_or(use.wrap);
    if (use.colour == Colour::by_depth) {
        use.colour = table.choice<Colour>("colour", kColours).value_or(use.colour);
    } else {
        table.refuse("colour", "this image holds data, which is linear");
    }
    table.finish();
}

/// A texture is "FILE" or a table; `use` is how it is read where the table does not specify it.
void read_texture_key(TableReader& table, const char* key, int Material::*slot, TextureUse use,
                      SceneReading& reading) {
    if (!table.has(key)) return;
    NamedTexture named{.material = static_cast<int>(reading.scene.materials.size()),
                       .slot = slot,
                       .key = key,
                       .path = {},
                       .use = use,
                       .place = table.place(key)};
    std::string file;
    if (table.is_text(key)) {
        file = *table.text(key);
    } else if (table.is_table(key)) {
        read_texture_table(*table.table(key), file, named.use);
    } else {
        return table.fail(key, "expected \"FILE\" or {file = \"FILE\", ...}");
    }
    named.path = (reading.folder / file).string();
    reading.textures.push_back(std::move(named));
}

void read_textures(TableReader& table, Material& m, SceneReading& reading) {
    using Colour = TextureUse::Colour;
    read_texture_key(table, "texture", &Material::texture, {}, reading);
    read_texture_key(table, "emission_texture", &Material::emission_texture, {}, reading);
    read_texture_key(table, "specular_texture", &Material::specular_texture, {.colour = Colour::linear}, reading);
    read_texture_key(table, "cloud_texture", &Material::cloud_texture, {.colour = Colour::linear}, reading);
    if (!table.has("cloud_texture")) table.refuse("cloud_albedo", "belongs to cloud_texture, which is not here");
    if (table.has("cloud_texture")) m.cloud_albedo = table.rgb("cloud_albedo", kUnit).value_or(kCloudAlbedo);
    read_texture_key(table, "normal_texture", &Material::normal_texture, {.colour = Colour::normals}, reading);
    read_texture_key(table, "height_texture", &Material::height_texture, {.colour = Colour::linear}, reading);
    if (table.has("emission_texture") && !table.has("emission"))
        table.fail("emission_texture", "multiplies the \"emission\", which is not here");
    m.normal_scale =
        static_cast<float>(table.number("normal_scale", {.low = 0, .high = 100}).value_or(m.normal_scale));
    m.bump_height_m = static_cast<float>(table.number("bump_height_m", {.low = -1e6, .high = 1e6}).value_or(0));
    if (!table.has("normal_texture")) table.refuse("normal_scale", "belongs to normal_texture, which is not here");
    if (!table.has("height_texture")) table.refuse("bump_height_m", "belongs to height_texture, which is not here");
    if (table.has("height_texture")) table.require("bump_height_m", "a number: how high white stands above black");
}

/// Reads everything but the kind.
void read_parameters(TableReader& table, Material& m, SceneReading& reading) {
    table.refuse_keys_of_other_kinds(name_of(m.kind, kMaterialKinds), kKindKeys);
    m.diffuse = table.rgb("albedo", kUnit).value_or(m.diffuse);
    read_specular(table, m);
    read_fresnel(table, m);
    read_regolith(table, m);
    if (reading.problems.none()) check_energy(table, m);
    m.retroreflectance =
        static_cast<float>(table.number("retroreflectance", {.low = 0, .high = 1e6}).value_or(m.retroreflectance));
    m.emission = table.rgb("emission", kRadiance).value_or(Rgb{});
    read_textures(table, m, reading);
    if (m.kind == Material::Kind::phong_classic && reading.scene.render.method == RenderSettings::Method::path)
        table.fail("kind", "\"phong_classic\" keeps no energy, expected \"phong\" where method = \"path\"");
    table.finish();
}

}  // namespace

std::optional<int> read_material(TableReader& body, const std::string& name, SceneReading& reading) {
    auto table = body.table("material");
    if (!table) return std::nullopt;
    Material m;
    m.name = name;
    const auto kind = table->choice<Material::Kind>("kind", kMaterialKinds);
    if (kind) m.kind = *kind;
    if (kind || !table->has("kind")) read_parameters(*table, m, reading);
    reading.scene.materials.push_back(std::move(m));
    return static_cast<int>(reading.scene.materials.size()) - 1;
}

int add_grey_material(const std::string& name, Scene& scene) {
    scene.materials.push_back({.name = name});
    return static_cast<int>(scene.materials.size()) - 1;
}

}  // namespace narpa
