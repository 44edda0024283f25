/// renderer/scene/texture_file.h - image files -> linear textures.
///
/// 8-bit images hold sRGB (IEC 61966-2-1) and are made linear; 16-bit images hold linear values already. Grey is
/// copied to the three bands; alpha is dropped; an orientation tag is not applied.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Any format that OpenCV decodes (PNG, JPEG, TIFF, WebP, BMP, PNM ...). Errors name the file.
Result<Texture> read_texture(const std::string& path);
/// The same from an image held in memory; `name` is for errors.
Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes);

}  // namespace narpa
