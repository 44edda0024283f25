#include <fmt/format.h>

#include <array>

#include "renderer/material/albedo.h"
#include "renderer/material/material_keys.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

/// Thick clouds reflect 0.6 to 0.9 (K. N. Liou, An Introduction to Atmospheric Radiation, 2nd ed. 2002).
constexpr Rgb kCloudAlbedo{0.75f, 0.75f, 0.75f};
constexpr TableKey kMaterialRows[]{
    {"kind", rows::kind("lambert")},
    {"retroreflectance", rows::number({.low = 0, .high = 1e6})},
    {"emission", rows::rgb({.low = 0, .high = 1e30})},
    {"emission_texture", kColourTexture},
    {"normal_texture", kDataTexture},
    {"normal_scale", rows::number({.low = 0, .high = 100})},
    {"height_texture", kDataTexture},
    {"bump_height_m", rows::number({.low = -1e6, .high = 1e6})},
    {"map_latitude", rows::choice<kMapLatitudeNames>()},
};

/// Records a problem where the surface would reflect more than it receives.
void check_energy(TableReader& table, const Material& m) {
    if (m.kind->energy_key.empty()) return;
    const float rounding = m.kind->largest_albedo == nullptr ? 5e-3f : 1e-6f;  // by quadrature, or exact
    const Rgb most = largest_albedo(m);
    for (int b = 0; b < 3; ++b)
        if (!(most[b] <= 1 + rounding))
            return table.fail(
                m.kind->energy_key,
                fmt::format("this surface sends back up to {:.3g} times the light that falls on it, in "
                            "band {}, expected at most 1",
                            most[b], b));
}

/// {file = "FILE", wrap = ..., colour = ...}; the last for colours only.
void read_texture_table(TableReader table, std::string& file, TextureUse& use) {
    using Colour = TextureUse::Colour;
    table.read("file", file);
    table.read("wrap", use.wrap);
    if (use.colour == Colour::by_depth) {
        if (const auto named = table.word("colour")) use.colour = *named == 0 ? Colour::srgb : Colour::linear;
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
    if (table.has("cloud_texture")) m.cloud_albedo = table.rgb("cloud_albedo").value_or(kCloudAlbedo);
    read_texture_key(table, "normal_texture", &Material::normal_texture, {.colour = Colour::normals}, reading);
    read_texture_key(table, "height_texture", &Material::height_texture, {.colour = Colour::linear}, reading);
    if (table.has("emission_texture") && !table.has("emission"))
        table.fail("emission_texture", "multiplies the \"emission\", which is not here");
    table.read("normal_scale", m.normal_scale);
    table.read("bump_height_m", m.bump_height_m);
    if (!table.has("normal_texture")) table.refuse("normal_scale", "belongs to normal_texture, which is not here");
    if (!table.has("height_texture")) table.refuse("bump_height_m", "belongs to height_texture, which is not here");
    if (table.has("height_texture")) table.require("bump_height_m", "a number: how high white stands above black");
}

/// `map_latitude`, after the textures that it is for.
void read_map_latitude(TableReader& table, bool on_globe, Material& m) {
    bool has_map = false;
    for (const char* key :
         {"texture", "emission_texture", "specular_texture", "cloud_texture", "normal_texture", "height_texture"})
        has_map |= table.has(key);
    if (!on_globe)
        table.refuse("map_latitude", "belongs to a sphere or an ellipsoid");
    else if (!has_map)
        table.refuse("map_latitude", "belongs to a texture, which is not here");
    table.read("map_latitude", m.map_latitude);
}

/// Reads everything but the kind.
void read_parameters(TableReader& table, bool on_globe, Material& m, SceneReading& reading) {
    m.kind->read(table, m);
    if (reading.problems.none()) check_energy(table, m);
    table.read("retroreflectance", m.retroreflectance);
    table.read("emission", m.emission);
    read_textures(table, m, reading);
    read_map_latitude(table, on_globe, m);
    if (m.kind->direct_only && reading.scene.render.method == RenderSettings::Method::path)
        table.fail("kind",
                   fmt::format("\"{}\" keeps no energy, expected \"phong\" where method = \"path\"", m.kind->name));
    table.finish();
}

}  // namespace

constinit const TableKeys kMaterialKeys{.rows = kMaterialRows, .kinds = kinds_of<bsdf_kinds>};

std::optional<int> read_material(TableReader& body, const std::string& name, SceneReading& reading) {
    auto table = body.table("material");
    if (!table) return std::nullopt;
    Material m;
    m.name = name;
    if (const auto kind = table->kind()) {
        m.kind = bsdf_kinds()[*kind];
        read_parameters(*table, body.has("sphere") || body.has("ellipsoid"), m, reading);
    }
    reading.scene.materials.push_back(std::move(m));
    return static_cast<int>(reading.scene.materials.size()) - 1;
}

int add_grey_material(const std::string& name, Scene& scene) {
    scene.materials.push_back({.name = name});
    return static_cast<int>(scene.materials.size()) - 1;
}

}  // namespace narpa
