/// renderer/scene/texture_file.h - image files -> linear textures, with their coarser levels.
///
/// Grey is copied to the three bands; alpha is dropped; an orientation tag is not applied.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// What an image is read for.
struct TextureUse {
    enum class Colour : std::uint8_t {
        by_depth,  ///< colours: 8 bits a band are sRGB (IEC 61966-2-1), 16 bits are linear already
        srgb,      ///< colours in sRGB, whatever the depth
        linear,    ///< colours in linear light, and data such as heights: full scale = 1, no curve
        normals,  ///< a normal map: linear, and code 128 of 8 bits is the middle, 0.5, as those who paint them mean
                  ///< it
    };
    Colour colour = Colour::by_depth;
    Texture::Wrap wrap = Texture::Wrap::repeat;
};

/// Most pixels of an image; with its coarser levels it takes 8 bytes for each, and twice that while it is read.
inline constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 28;

/// PNG, JPEG, TIFF, WebP, BMP and PNM, whatever the file's name; OpenCV decodes them. Errors name the file.
Result<Texture> read_texture(const std::string& path, const TextureUse& use = {});
/// The same from an image held in memory; `name` is for errors.
Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes,
                               const TextureUse& use = {});

}  // namespace narpa
