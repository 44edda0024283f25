/// renderer/material/texture_lookup.h - filtered texture values. v is up; (0, 0) is the bottom left corner of the
/// bottom left texel.
///
/// Nothing here allocates but `build_coarser_levels`. Coordinates that are no numbers give 1.
#pragma once

#include <array>
#include <cstdint>

#include "renderer/material/material.h"

namespace narpa {

/// What lies beyond the edges of the image.
enum class TextureLayout : std::uint8_t {
    flat,   ///< what Texture::wrap says
    globe,  ///< u goes around; over v = 1 and v = 0, the poles, the way leads to the other side, u + 1/2
};

/// The area of the texture that a pixel sees: an ellipse about (u, v) with these two half axes' ends, in texture
/// coordinates (not texels). Any two conjugate half axes will do: the images of two perpendicular radii of a
/// circle.
struct TextureFootprint {
    std::array<float, 2> axis1{}, axis2{};  ///< (du, dv)

    friend bool operator==(const TextureFootprint&, const TextureFootprint&) = default;
};

/// Mean over the footprint: several trilinear lookups along its longer axis, up to 15, so that it may be 15 times
/// as long as wide before its width is blurred too (anisotropic filtering). It is the bilinear value where the
/// footprint is a texel or less, goes over from one to the other without a step, and keeps the image's mean.
[[nodiscard]] Rgb texture_lookup(const Texture& texture, float u, float v, const TextureFootprint& footprint = {},
                                 TextureLayout layout = TextureLayout::flat) noexcept;

/// Asks memory for the texels of a lookup without a footprint. Lookups of a batch do well to wait side by side.
void prefetch_texels(const Texture& texture, float u, float v, TextureLayout layout) noexcept;

/// Change of the mean of the three bands per unit of u and of v.
struct TextureSlope {
    float du = 0, dv = 0;
};
/// Central difference of lookups as above, across one texel of the level that the footprint asks for.
[[nodiscard]] TextureSlope texture_slope(const Texture& texture, float u, float v,
                                         const TextureFootprint& footprint,
                                         TextureLayout layout = TextureLayout::flat) noexcept;

/// Makes Texture::coarser: halves (rounded down, at least 1), each texel the exact mean of the area that it covers
/// in the finest level, rounded once.
void build_coarser_levels(Texture& texture);

}  // namespace narpa
