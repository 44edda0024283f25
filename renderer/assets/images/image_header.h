/// renderer/assets/images/image_header.h - what an image file declares in its header: what is checked before a
/// decoder allocates memory for it, and what the decoders of OpenCV pass over.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "renderer/assets/images/decoded_image.h"

namespace narpa {

struct ImageHeader {
    enum class Format : std::uint8_t { png, jpeg, tiff, webp, bmp, pnm, pam };
    Format format = Format::png;
    std::uint64_t width = 0, height = 0;
    bool has_alpha = false;
    bool is_grey = false;                   ///< PNG, with or without alpha
    std::uint32_t largest = 0;              ///< PNM and PAM: the sample of full scale; 0: not declared
    int channels = 0;                       ///< PNM of numbers, and PAM with alpha
    std::size_t data = 0;                   ///< of these: where the samples begin
    bool is_text = false;                   ///< of these: samples in decimal
    std::array<int, 3> significant_bits{};  ///< PNG, of red, green, blue or three times grey; 0: not declared
    TransferCurve transfer{};
    std::string refusal{};              ///< what is declared and cannot be read; empty: nothing
    std::vector<std::string> unused{};  ///< as in DecodedImage
};

/// Nothing where the bytes do not begin as PNG, JPEG, TIFF, WebP, BMP, PNM or PAM files do, or give no size above
/// 0. Of TIFF only the size: libtiff reads the rest.
std::optional<ImageHeader> image_header(std::span<const std::uint8_t> bytes);

/// The name of a known image format that is none of these; empty where the bytes are not known either.
std::string name_of_other_format(std::span<const std::uint8_t> bytes);

/// Whether this ICC profile says by its name that colours are sRGB, with that curve.
bool is_srgb_profile(std::string_view profile);

}  // namespace narpa
