/// renderer/material/material_keys.h - keys of materials that several kinds read.
#pragma once

#include <string_view>

#include "renderer/material/bsdf_kind.h"

namespace narpa {

inline constexpr std::string_view kAlbedoKeys[] = {"albedo", "texture"};

/// `albedo`
void read_albedo(TableReader& table, Material& m);
/// `ior` within the limits, `fresnel`
void read_fresnel(TableReader& table, Material& m, double ior_min, double ior_max);

}  // namespace narpa
