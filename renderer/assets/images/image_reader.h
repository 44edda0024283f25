/// renderer/assets/images/image_reader.h - image files -> samples: the one reader of textures, frames and point
/// spreads.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "base/result.h"
#include "renderer/assets/images/decoded_image.h"

namespace narpa {

/// Most pixels of an image, and most in each direction.
inline constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 28, kMaxSide = std::uint64_t{1} << 20;

/// PNG, JPEG, TIFF, WebP, BMP, PNM (P1 to P6) and PAM, whatever the file's name; what each format declares is used,
/// named in DecodedImage::unused, or an error (docs/scene.md, "Textures"). Alpha is dropped. `name` is that of the
/// file, for errors.
Result<DecodedImage> decode_image(const std::string& name, std::span<const std::uint8_t> bytes);

}  // namespace narpa
