/// base/pixel_format.h - the pixel formats that narpa puts out, by their V4L2 names.
#pragma once

#include <algorithm>
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

/// What is known of a format. A text is empty where the protocol has no code for it.
struct PixelFormatRow {
    PixelFormat format;
    std::string_view name;
    std::size_t bytes;          ///< per pixel
    bool mono, is_16_bit;       ///< see is_mono, is_16_bit
    std::string_view v4l2;      ///< four characters
    std::string_view y4m;       ///< colour space
    std::string_view uvc{};     ///< first four characters of the GUID
    std::string_view mosaic{};  ///< bands of the first two pixels of the first two rows
};
inline constexpr std::array<PixelFormatRow, 12> kPixelFormats{{
    {PixelFormat::grey, "GREY", 1, true, false, "GREY", "mono", "Y800"},
    {PixelFormat::y16, "Y16", 2, true, true, "Y16 ", "mono16", "Y16 "},
    {PixelFormat::yuyv, "YUYV", 2, false, false, "YUYV", "422", "YUY2"},
    {PixelFormat::rgb24, "RGB24", 3, false, false, "RGB3", ""},
    {PixelFormat::rggb8, "RGGB8", 1, false, false, "RGGB", "", "", "RGGB"},
    {PixelFormat::grbg8, "GRBG8", 1, false, false, "GRBG", "", "", "GRBG"},
    {PixelFormat::gbrg8, "GBRG8", 1, false, false, "GBRG", "", "", "GBRG"},
    {PixelFormat::bggr8, "BGGR8", 1, false, false, "BA81", "", "", "BGGR"},
    {PixelFormat::rggb16, "RGGB16", 2, false, true, "RG16", "", "", "RGGB"},
    {PixelFormat::grbg16, "GRBG16", 2, false, true, "GR16", "", "", "GRBG"},
    {PixelFormat::gbrg16, "GBRG16", 2, false, true, "GB16", "", "", "GBRG"},
    {PixelFormat::bggr16, "BGGR16", 2, false, true, "BYR2", "", "", "BGGR"},
}};
[[nodiscard]] constexpr const PixelFormatRow& row_of(PixelFormat f) {
    return *std::ranges::find(kPixelFormats, f, &PixelFormatRow::format);
}
inline constexpr auto kPixelFormatNames = [] {
    std::array<std::string_view, kPixelFormats.size()> names;
    std::ranges::transform(kPixelFormats, names.begin(), &PixelFormatRow::name);
    return names;
}();
/// The format whose code in this column of the table is `code`.
[[nodiscard]] constexpr std::optional<PixelFormat> pixel_format_from(
    std::string_view code, std::string_view PixelFormatRow::*column = &PixelFormatRow::name) {
    for (const PixelFormatRow& row : kPixelFormats)
        if (row.*column == code) return row.format;
    return std::nullopt;
}
[[nodiscard]] constexpr std::string_view name(PixelFormat f) {
    return row_of(f).name;
}

[[nodiscard]] constexpr bool is_bayer(PixelFormat f) {
    return !row_of(f).mosaic.empty();
}
/// A pixel collects the light of all bands.
[[nodiscard]] constexpr bool is_mono(PixelFormat f) {
    return row_of(f).mono;
}
/// Samples have 16 bits, little-endian, the ADC's bits left-justified.
[[nodiscard]] constexpr bool is_16_bit(PixelFormat f) {
    return row_of(f).is_16_bit;
}
[[nodiscard]] constexpr std::size_t bytes_per_pixel(PixelFormat f) {
    return row_of(f).bytes;
}
[[nodiscard]] constexpr std::size_t frame_bytes(const VideoFormat& f) {
    return static_cast<std::size_t>(f.width) * static_cast<std::size_t>(f.height) * bytes_per_pixel(f.pixel);
}

/// The band of a mosaic's pixel: 0 red, 1 green, 2 blue.
[[nodiscard]] constexpr std::uint32_t bayer_band(PixelFormat f, int x, int y) {
    const char band = row_of(f).mosaic[static_cast<std::size_t>(2 * (y & 1) + (x & 1))];
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
