/// base/pixel_format.h - the pixel formats that narpa puts out, by their V4L2 names: samples, and what links make
/// of them.
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

/// How a link lays out the rows of a frame; the samples themselves stay as they are everywhere else.
struct LinkLayout {
    enum class Kind : std::uint8_t {
        samples,  ///< as they are; the only one of samples that do not have 16 bits
        right,    ///< right-justified in 16 bits
        mipi,     ///< MIPI CSI-2 RAW10 and RAW12: the high bytes of 4 or 2 pixels, then a byte of their low bits
        genicam,  ///< GenICam's Mono10p and Mono12p: the bits of one pixel after another, lowest first
    };
    Kind kind = Kind::samples;
    std::uint8_t bits = 16;              ///< of a pixel: the ADC's
    std::uint16_t first_bytes_kept = 0;  ///< of the last row: an embedded line, which is not laid out
    bool big_endian = false;             ///< of elements of 16 bits
    std::uint32_t row_bytes = 0;         ///< with padding, which is 0; 0: none
    [[nodiscard]] bool is_samples() const { return kind == Kind::samples && has_plain_rows(); }
    /// Little-endian without padding, as protocols expect that cannot tell.
    [[nodiscard]] constexpr bool has_plain_rows() const { return !big_endian && row_bytes == 0; }
    [[nodiscard]] constexpr bool is_packed() const { return kind == Kind::mipi || kind == Kind::genicam; }
    friend bool operator==(const LinkLayout&, const LinkLayout&) = default;
};

struct VideoFormat {
    int width = 0, height = 0;
    PixelFormat pixel = PixelFormat::grey;
    std::int64_t period_ns = 100'000'000;  ///< 1 / frame rate
    LinkLayout link{};
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

/// A format of a link: samples of a format of 16 bits, laid out. Names and codes are V4L2's, or names are those of
/// GenICam's Pixel Format Naming Convention, which V4L2 has no codes for.
struct LinkFormatRow {
    std::string_view name;
    PixelFormat samples;
    LinkLayout layout;
    std::string_view v4l2{};
    std::string_view y4m{};
};
inline constexpr auto kLinkFormats = [] {
    using Kind = LinkLayout::Kind;
    constexpr LinkLayout r10{Kind::right, 10}, r12{Kind::right, 12}, r14{Kind::right, 14}, p10{Kind::mipi, 10},
        p12{Kind::mipi, 12}, g10{Kind::genicam, 10}, g12{Kind::genicam, 12};
    constexpr PixelFormat y = PixelFormat::y16, rg = PixelFormat::rggb16, gr = PixelFormat::grbg16,
                          gb = PixelFormat::gbrg16, bg = PixelFormat::bggr16;
    return std::to_array<LinkFormatRow>({
        {"Y10", y, r10, "Y10 ", "mono10"},
        {"Y12", y, r12, "Y12 ", "mono12"},
        {"Y14", y, r14, "Y14 "},
        {"Y10P", y, p10, "Y10P"},
        {"Y12P", y, p12, "Y12P"},
        {"RGGB10", rg, r10, "RG10"},
        {"RGGB12", rg, r12, "RG12"},
        {"RGGB14", rg, r14, "RG14"},
        {"RGGB10P", rg, p10, "pRAA"},
        {"RGGB12P", rg, p12, "pRCC"},
        {"GRBG10", gr, r10, "BA10"},
        {"GRBG12", gr, r12, "BA12"},
        {"GRBG14", gr, r14, "GR14"},
        {"GRBG10P", gr, p10, "pgAA"},
        {"GRBG12P", gr, p12, "pgCC"},
        {"GBRG10", gb, r10, "GB10"},
        {"GBRG12", gb, r12, "GB12"},
        {"GBRG14", gb, r14, "GB14"},
        {"GBRG10P", gb, p10, "pGAA"},
        {"GBRG12P", gb, p12, "pGCC"},
        {"BGGR10", bg, r10, "BG10"},
        {"BGGR12", bg, r12, "BG12"},
        {"BGGR14", bg, r14, "BG14"},
        {"BGGR10P", bg, p10, "pBAA"},
        {"BGGR12P", bg, p12, "pBCC"},
        {"Mono10p", y, g10},
        {"Mono12p", y, g12},
        {"BayerRG10p", rg, g10},
        {"BayerRG12p", rg, g12},
        {"BayerGR10p", gr, g10},
        {"BayerGR12p", gr, g12},
        {"BayerGB10p", gb, g10},
        {"BayerGB12p", gb, g12},
        {"BayerBG10p", bg, g10},
        {"BayerBG12p", bg, g12},
    });
}();
/// All names that a camera's `format` may have: those of samples, then those of links.
inline constexpr auto kCameraFormatNames = [] {
    std::array<std::string_view, kPixelFormats.size() + kLinkFormats.size()> names;
    auto end = std::ranges::transform(kPixelFormats, names.begin(), &PixelFormatRow::name).out;
    std::ranges::transform(kLinkFormats, end, &LinkFormatRow::name);
    return names;
}();
/// The row of a format that is laid out for its link; null: the link has the samples.
[[nodiscard]] constexpr const LinkFormatRow* link_format_of(PixelFormat samples, const LinkLayout& layout) {
    for (const LinkFormatRow& row : kLinkFormats)
        if (row.samples == samples && row.layout.kind == layout.kind && row.layout.bits == layout.bits) return &row;
    return nullptr;
}
/// The name of what a link carries, without byte order and padding.
[[nodiscard]] constexpr std::string_view link_name(PixelFormat samples, const LinkLayout& layout) {
    const LinkFormatRow* row = link_format_of(samples, layout);
    return row != nullptr ? row->name : name(samples);
}
/// With them: "Y12-BE with rows of 1312 bytes".
[[nodiscard]] inline std::string link_text(PixelFormat samples, const LinkLayout& layout) {
    return std::string(link_name(samples, layout)) + (layout.big_endian ? "-BE" : "") +
           (layout.row_bytes != 0 ? " with rows of " + std::to_string(layout.row_bytes) + " bytes" : "");
}
/// V4L2 marks big-endian formats in its codes (v4l2_fourcc_be): this bit of the last character.
inline constexpr std::uint8_t kBigEndianMark = 0x80;
/// V4L2's code of what a link carries, four characters; empty: it has none.
[[nodiscard]] inline std::string link_code(PixelFormat samples, const LinkLayout& layout) {
    const LinkFormatRow* row = link_format_of(samples, layout);
    std::string code(row != nullptr ? row->v4l2 : row_of(samples).v4l2);
    if (layout.big_endian && !code.empty()) code.back() = static_cast<char>(code.back() | kBigEndianMark);
    return code;
}
/// Y4M's colour space of what a link carries; empty: it has none.
[[nodiscard]] constexpr std::string_view link_y4m(PixelFormat samples, const LinkLayout& layout) {
    if (!layout.has_plain_rows()) return {};
    const LinkFormatRow* row = link_format_of(samples, layout);
    return row != nullptr ? row->y4m : row_of(samples).y4m;
}
struct LinkPixels {
    PixelFormat samples = PixelFormat::grey;
    LinkLayout layout{};
};
/// What V4L2's code stands for.
[[nodiscard]] inline std::optional<LinkPixels> link_from_code(std::string code) {
    if (code.empty()) return std::nullopt;
    const bool big_endian = (static_cast<std::uint8_t>(code.back()) & kBigEndianMark) != 0;
    code.back() = static_cast<char>(code.back() & ~kBigEndianMark);
    std::optional<LinkPixels> found;
    for (const LinkFormatRow& row : kLinkFormats)
        if (row.v4l2 == code) found = LinkPixels{row.samples, row.layout};
    if (const auto samples = pixel_format_from(code, &PixelFormatRow::v4l2)) found = LinkPixels{*samples, {}};
    if (!found || !big_endian) return found;
    if (!row_of(found->samples).is_16_bit || found->layout.is_packed()) return std::nullopt;
    found->layout.big_endian = true;
    return found;
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
/// Of samples.
[[nodiscard]] constexpr std::size_t frame_bytes(const VideoFormat& f) {
    return static_cast<std::size_t>(f.width) * static_cast<std::size_t>(f.height) * bytes_per_pixel(f.pixel);
}
/// Of a row on the link without its padding, with it, and of a frame. Packed pixels come in groups of whole bytes
/// (unfit_layout).
[[nodiscard]] constexpr std::size_t link_pixel_bytes(std::size_t width, PixelFormat samples,
                                                     const LinkLayout& layout) {
    return layout.is_packed() ? width * layout.bits / 8 : width * bytes_per_pixel(samples);
}
[[nodiscard]] constexpr std::size_t link_row_bytes(std::size_t width, PixelFormat samples,
                                                   const LinkLayout& layout) {
    return layout.row_bytes != 0 ? layout.row_bytes : link_pixel_bytes(width, samples, layout);
}
[[nodiscard]] constexpr std::size_t link_row_bytes(const VideoFormat& f) {
    return link_row_bytes(static_cast<std::size_t>(f.width), f.pixel, f.link);
}
[[nodiscard]] constexpr std::size_t link_bytes(const VideoFormat& f) {
    return link_row_bytes(f) * static_cast<std::size_t>(f.height);
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
/// The longest row of a link, with its padding.
inline constexpr std::uint32_t kLinkRowBytesMost = 1 << 20;
/// Why rows of this width cannot be laid out, or an empty text.
[[nodiscard]] inline std::string unfit_layout(PixelFormat f, const LinkLayout& layout, int width) {
    const int group = !layout.is_packed() ? 1 : layout.bits == 10 ? 4 : 2;
    if (width % group != 0)
        return std::string(link_name(f, layout)) + " holds " + std::to_string(group) +
               " pixels together, expected a width that is a multiple of " + std::to_string(group) + ", not " +
               std::to_string(width);
    if (layout.big_endian && (!is_16_bit(f) || layout.is_packed()))
        return std::string(link_name(f, layout)) +
               " has no byte order, expected a format of 16 bits for a big-endian one";
    const std::size_t least = link_pixel_bytes(static_cast<std::size_t>(width), f, layout);
    if (layout.row_bytes != 0 && (layout.row_bytes < least || layout.row_bytes > kLinkRowBytesMost))
        return "rows of " + std::to_string(layout.row_bytes) + " bytes, expected " + std::to_string(least) +
               " (the pixels of a row) to " + std::to_string(kLinkRowBytesMost);
    return {};
}
/// The rows that a header states; false: they are too short for the pixels, or too long.
[[nodiscard]] inline bool take_row_bytes(std::uint32_t row_bytes, std::size_t width, PixelFormat samples,
                                         LinkLayout& layout) {
    const std::size_t least = link_pixel_bytes(width, samples, layout);
    layout.row_bytes = row_bytes == least ? 0 : row_bytes;
    return row_bytes >= least && (row_bytes == least || row_bytes <= kLinkRowBytesMost);
}
/// Of two formats of the same samples: the same bytes on the link.
[[nodiscard]] inline bool is_same_on_link(const VideoFormat& a, const VideoFormat& b) {
    return a.width == b.width && a.height == b.height && link_row_bytes(a) == link_row_bytes(b) &&
           link_name(a.pixel, a.link) == link_name(b.pixel, b.link) && a.link.big_endian == b.link.big_endian;
}

}  // namespace narpa
