#include "renderer/material/material_keys.h"

#include <array>

#include "renderer/keys/toml_reader.h"

namespace narpa {

void read_albedo(TableReader& table, Material& m) {
    m.diffuse = table.rgb("albedo", kUnit).value_or(m.diffuse);
}

void read_fresnel(TableReader& table, Material& m, double ior_min, double ior_max) {
    static constexpr std::array<std::pair<std::string_view, bool>, 2> kFresnel{
        {{"exact", false}, {"schlick", true}}};
    m.ior = static_cast<float>(table.number("ior", {.low = ior_min, .high = ior_max}).value_or(m.ior));
    m.schlick = table.choice<bool>("fresnel", kFresnel).value_or(m.schlick);
}

}  // namespace narpa
