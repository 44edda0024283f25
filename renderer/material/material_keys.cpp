#include "renderer/material/material_keys.h"

#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr std::array<std::string_view, 2> kWrapNames{"repeat", "clamp"}, kColourNames{"srgb", "linear"};
constexpr TableKey kTextureRows[]{
    {"file", rows::file(), "the name of an image file"},
    {"wrap", rows::choice<kWrapNames>()},
    {"colour", rows::choice<kColourNames>()},
};

}  // namespace

constinit const TableKeys kColourTextureKeys{.rows = kTextureRows},
    kDataTextureKeys{.rows = std::span(kTextureRows).first(2)};

void read_albedo(TableReader& table, Material& m) {
    table.read("albedo", m.diffuse);
}

void read_fresnel(TableReader& table, Material& m) {
    table.read("ior", m.ior);
    m.schlick = table.word("fresnel") == 1u;
}

}  // namespace narpa
