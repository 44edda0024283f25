/// renderer/assets/texture_file.h - image files -> linear textures with mipmaps.
///
/// Grey is copied to the three bands; alpha is dropped; an orientation tag is not applied.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// How an image is interpreted.
struct TextureUse {
    enum class Colour : std::uint8_t {
        by_depth,  ///< colours: 8 bits a band are sRGB (IEC 61966-2-1), 16 bits are linear already
        srgb,      ///< colours in sRGB, whatever the depth
        linear,    ///< colours in linear light, and data such as heights: full scale = 1, no curve
        normals,   ///< a normal map: linear, with code 128 of 8 bits as 0.5, by convention
    };
    Colour colour = Colour::by_depth;
    Texture::Wrap wrap = Texture::Wrap::repeat;
};

/// Most pixels of an image; with its mipmaps it takes 8 bytes for each, and twice that while it is read.
inline constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 28;

/// PNG, JPEG, TIFF, WebP, BMP and PNM, whatever the file's name; OpenCV decodes them. Errors name the file.
Result<Texture> read_texture(const std::string& path, const TextureUse& use = {});
/// The same from an image held in memory; `name` is for errors.
Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes,
                               const TextureUse& use = {});

}  // namespace narpa
