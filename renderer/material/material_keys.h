/// renderer/material/material_keys.h - keys of materials that several kinds have.
#pragma once

#include <array>
#include <string_view>

#include "renderer/keys/keys.h"
#include "renderer/material/bsdf_kind.h"

namespace narpa {

/// A texture is "FILE" or {file = "FILE", wrap = ..., colour = ...}; one of data, such as heights, has no colour.
extern const TableKeys kColourTextureKeys, kDataTextureKeys;
inline constexpr KeyValue kColourTexture = rows::or_file(rows::table(kColourTextureKeys)),
                          kDataTexture = rows::or_file(rows::table(kDataTextureKeys));

inline constexpr std::array<std::string_view, 2> kFresnelNames{"exact", "schlick"};
inline constexpr TableKey kAlbedoRow{"albedo", rows::rgb(kUnit)}, kTextureRow{"texture", kColourTexture},
    kSpecularTextureRow{"specular_texture", kDataTexture}, kCloudTextureRow{"cloud_texture", kDataTexture},
    kCloudAlbedoRow{"cloud_albedo", rows::rgb(kUnit)}, kFresnelRow{"fresnel", rows::choice<kFresnelNames>()};
inline constexpr TableKey kAlbedoRows[]{kAlbedoRow, kTextureRow};

/// `albedo`
void read_albedo(TableReader& table, Material& m);
/// `ior`, `fresnel`
void read_fresnel(TableReader& table, Material& m);

}  // namespace narpa
