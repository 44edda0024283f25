/// renderer/material/texture_lookup.h - filtered texture values. v is up; (0, 0) is the bottom left corner of the
/// bottom left texel.
#pragma once

#include <array>

#include "renderer/scene/scene.h"

namespace narpa {

/// Bilinear in the finest level.
[[nodiscard]] Rgb texture_lookup(const Texture& texture, float u, float v) noexcept;

/// The area of the texture that a pixel sees: an ellipse about (u, v) with these two half axes' ends, in texture
/// coordinates (not texels).
struct TextureFootprint {
    std::array<float, 2> axis1{}, axis2{};  ///< (du, dv)
};

/// Mean over the footprint: several trilinear lookups along its longer axis, up to 16 (anisotropic filtering).
[[nodiscard]] Rgb texture_lookup(const Texture& texture, float u, float v, const TextureFootprint& footprint) noexcept;

/// Makes Texture::coarser: halves (rounded down, at least 1), each texel the exact mean of the area that it covers.
void build_coarser_levels(Texture& texture);

}  // namespace narpa
