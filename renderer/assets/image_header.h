/// renderer/assets/image_header.h - the size of an image file, from its first bytes: what is checked before a
/// decoder allocates memory for it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace narpa {

struct ImageSize {
    std::uint64_t width = 0, height = 0;
};

/// Nothing where the bytes do not begin as PNG, JPEG, TIFF, WebP, BMP or PNM files do, or give no size above 0.
std::optional<ImageSize> image_size(std::span<const std::uint8_t> bytes);

}  // namespace narpa
