/// renderer/material/texture/texture_lookup.h - filtered texture values. v is up; (0, 0) is the bottom left corner
/// of the bottom left texel.
///
/// Only `build_coarser_levels` allocates. NaN or infinite coordinates give 1.
#pragma once

#include <array>
#include <cstdint>

#include "renderer/material/material.h"

namespace narpa {

/// Texture coordinates beyond the edges of the image.
enum class TextureLayout : std::uint8_t {
    flat,   ///< as Texture::wrap
    globe,  ///< u wraps around; beyond the poles, v = 1 and v = 0, v is mirrored and u shifts by 1/2
};

/// Footprint of a pixel in the texture: an ellipse about (u, v) given by two conjugate half axes, in texture
/// coordinates (not texels), e.g. the images of two perpendicular radii of a circle.
struct TextureFootprint {
    std::array<float, 2> axis1{}, axis2{};  ///< (du, dv)

    friend bool operator==(const TextureFootprint&, const TextureFootprint&) = default;
};

/// Anisotropic filtering over the footprint: up to 15 trilinear lookups along its longer axis, so that it may be 15
/// times as long as wide before its width is blurred too. Equals the bilinear value if the footprint is a texel or
/// less, changes continuously between the two, and preserves the image's mean.
[[nodiscard]] Rgb texture_lookup(const Texture& texture, float u, float v, const TextureFootprint& footprint = {},
                                 TextureLayout layout = TextureLayout::flat) noexcept;

/// Change of the mean of the three bands per unit of u and of v.
struct TextureSlope {
    float du = 0, dv = 0;
};
/// Central difference of such lookups, across one texel of the mip level for the footprint.
[[nodiscard]] TextureSlope texture_slope(const Texture& texture, float u, float v,
                                         const TextureFootprint& footprint,
                                         TextureLayout layout = TextureLayout::flat) noexcept;

/// Builds the mip levels Texture::coarser: sizes halve (rounded down, at least 1), each texel the exact mean of the
/// area that it covers in the finest level, rounded once.
void build_coarser_levels(Texture& texture);

}  // namespace narpa
