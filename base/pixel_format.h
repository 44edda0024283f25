/// base/pixel_format.h - the pixel formats that narpa puts out, by their V4L2 names.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace narpa {

/// GREY: 8-bit luma. Y16: 16-bit little-endian luma, the ADC's bits left-justified. YUYV: 4:2:2, BT.601 limited
/// range. RGB24: 8-bit R, G, B. The others are Bayer mosaics: one band a pixel, named by the bands of the first two
/// pixels of the first two rows; 8 bits, or 16 bits as in Y16.
enum class PixelFormat : std::uint8_t {
    grey,
    y16,
    yuyv,
    rgb24,
    rggb8,
    grbg8,
    gbrg8,
    bggr8,
    rggb16,
    grbg16,
    gbrg16,
    bggr16,
};

struct VideoFormat {
    int width = 0, height = 0;
    PixelFormat pixel = PixelFormat::grey;
    std::int64_t period_ns = 100'000'000;  ///< 1 / frame rate
};

[[nodiscard]] constexpr bool is_bayer(PixelFormat f) {
    return f >= PixelFormat::rggb8;
}
/// A pixel collects the light of all bands.
[[nodiscard]] constexpr bool is_mono(PixelFormat f) {
    return f == PixelFormat::grey || f == PixelFormat::y16;
}
/// Samples have 16 bits, little-endian, the ADC's bits left-justified.
[[nodiscard]] constexpr bool is_16_bit(PixelFormat f) {
    return f == PixelFormat::y16 || f >= PixelFormat::rggb16;
}
[[nodiscard]] constexpr std::size_t bytes_per_pixel(PixelFormat f) {
    if (f == PixelFormat::rgb24) return 3;
    return f == PixelFormat::yuyv || is_16_bit(f) ? 2 : 1;
}
[[nodiscard]] constexpr std::size_t frame_bytes(const VideoFormat& f) {
    return static_cast<std::size_t>(f.width) * static_cast<std::size_t>(f.height) * bytes_per_pixel(f.pixel);
}

inline constexpr std::array<std::string_view, 12> kPixelFormatNames{
    "GREY", "Y16", "YUYV", "RGB24", "RGGB8", "GRBG8", "GBRG8", "BGGR8", "RGGB16", "GRBG16", "GBRG16", "BGGR16"};
[[nodiscard]] constexpr std::string_view name(PixelFormat f) {
    return kPixelFormatNames[static_cast<std::size_t>(f)];
}
[[nodiscard]] constexpr std::optional<PixelFormat> pixel_format_from(std::string_view text) {
    for (std::size_t i = 0; i < kPixelFormatNames.size(); ++i)
        if (kPixelFormatNames[i] == text) return static_cast<PixelFormat>(i);
    return std::nullopt;
}
/// The band of a mosaic's pixel: 0 red, 1 green, 2 blue.
[[nodiscard]] constexpr std::uint32_t bayer_band(PixelFormat f, int x, int y) {
    const char band = name(f)[static_cast<std::size_t>(2 * (y & 1) + (x & 1))];
    return band == 'R' ? 0 : band == 'G' ? 1 : 2;
}

/// Why a frame of this size is not possible, or an empty text: YUYV holds pixels in pairs, a mosaic in 2 x 2.
[[nodiscard]] inline std::string unfit_size(PixelFormat f, int width, int height) {
    const auto text = [&](const char* what, int is) {
        return std::string(name(f)) + " needs an even " + what + ", not " + std::to_string(is);
    };
    if ((f == PixelFormat::yuyv || is_bayer(f)) && width % 2 != 0) return text("width", width);
    if (is_bayer(f) && height % 2 != 0) return text("height", height);
    return {};
}

}  // namespace narpa
