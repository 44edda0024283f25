/// renderer/assets/images/texture_file.h - image files -> linear textures with mipmaps.
///
/// Grey is copied to the three bands; alpha is dropped.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/assets/images/image_reader.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// How an image is interpreted.
struct TextureUse {
    enum class Colour : std::uint8_t {
        by_depth,  ///< colours: the curve that the file declares, else up to 8 bits a band are sRGB (IEC
                   ///< 61966-2-1), and more are linear already
        srgb,      ///< colours in sRGB, whatever the file declares
        linear,    ///< colours in linear light, and data such as heights: full scale = 1, no curve
        normals,   ///< a normal map: linear, with code 128 of 8 bits as 0.5, by convention
    };
    Colour colour = Colour::by_depth;
    Texture::Wrap wrap = Texture::Wrap::repeat;
};

/// The images of decode_image, of up to kMaxPixels; with its mipmaps a texture takes 8 bytes for each pixel, and
/// twice that while it is read. Errors name the file. `warnings`: where sentences go about what the file declares
/// and is not used.
Result<Texture> read_texture(const std::string& path, const TextureUse& use = {},
                             std::vector<std::string>* warnings = nullptr);
/// The same from an image held in memory; `name` is for errors.
Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes,
                               const TextureUse& use = {}, std::vector<std::string>* warnings = nullptr);

/// A code of sRGB (IEC 61966-2-1), 0 to 1, as linear light.
[[nodiscard]] double linear_from_srgb(double code);

}  // namespace narpa
