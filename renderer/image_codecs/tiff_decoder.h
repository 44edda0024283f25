/// renderer/image_codecs/tiff_decoder.h - TIFF and BigTIFF with libtiff: OpenCV passes over photometric
/// interpretation and planes of more than 8 bits, and reads neither BigTIFF nor 2 and 4 bits.
#pragma once

#include <cstdint>
#include <span>

#include "base/result.h"
#include "renderer/assets/images/decoded_image.h"

namespace narpa {

/// The first image of the file, turned by its orientation.
///   samples   grey and RGB of 1 to 16 or 32 bits, or 32-bit or 64-bit floats, interleaved or in planes, in strips
///             or tiles; palettes of up to 8 bits, YCbCr, CMYK and CIELab of 8 bits by libtiff's conversion to RGB
///   errors    other samples, with their names; damaged files
Result<DecodedImage> decode_tiff(std::span<const std::uint8_t> bytes);

}  // namespace narpa
