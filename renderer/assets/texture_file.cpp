#include "renderer/assets/texture_file.h"

#include <fmt/format.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "base/file_bytes.h"
#include "renderer/assets/image_codecs.h"
#include "renderer/assets/image_header.h"
#include "renderer/material/texture_lookup.h"

namespace narpa {
namespace {

using Colour = TextureUse::Colour;

/// Lookup table from code to linear light, 65535 = 1.0.
using Table = std::vector<std::uint16_t>;

template <class Curve>
Table table_of(int count, Curve linear) {
    Table table;
    for (int code = 0; code < count; ++code)
        table.push_back(static_cast<std::uint16_t>(std::lround(65535.0 * linear(code / (count - 1.0)))));
    return table;
}

/// IEC 61966-2-1.
double linear_from_srgb(double s) {
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

double from_middle_at_128(double s) {
    const double code = 255 * s;
    return code <= 128 ? code / 256 : 0.5 + (code - 128) / 254;
}

/// The lookup table for this bit depth, made once.
const Table& table_for(int bits, Colour colour) {
    const int count = 1 << bits;
    if (colour == Colour::srgb || (colour == Colour::by_depth && bits == 8)) {
        static const Table eight = table_of(1 << 8, linear_from_srgb);
        if (bits == 8) return eight;
        static const Table sixteen = table_of(1 << 16, linear_from_srgb);
        return sixteen;
    }
    if (colour == Colour::normals && bits == 8) {
        static const Table normals = table_of(count, from_middle_at_128);
        return normals;
    }
    const auto same = [](double s) { return s; };
    static const Table eight = table_of(1 << 8, same);
    if (bits == 8) return eight;
    static const Table sixteen = table_of(1 << 16, same);
    return sixteen;
}

/// OpenCV stores blue first.
template <class Sample>
void copy_rgb(const cv::Mat& bgr, const Table& linear, std::uint16_t* out) {
    for (int y = 0; y < bgr.rows; ++y) {
        const Sample* in = bgr.ptr<Sample>(y);
        for (int x = 0; x < bgr.cols; ++x, in += 3, out += 3) {
            out[0] = linear[in[2]];
            out[1] = linear[in[1]];
            out[2] = linear[in[0]];
        }
    }
}

Result<Texture> from_image(const std::string& name, const cv::Mat& bgr, const TextureUse& use) {
    Texture texture{.name = name, .width = bgr.cols, .height = bgr.rows, .rgb = {}, .wrap = use.wrap};
    texture.rgb.resize(3 * bgr.total());
    if (bgr.type() == CV_8UC3) {
        copy_rgb<std::uint8_t>(bgr, table_for(8, use.colour), texture.rgb.data());
    } else if (bgr.type() == CV_16UC3) {
        copy_rgb<std::uint16_t>(bgr, table_for(16, use.colour), texture.rgb.data());
    } else {
        return Error{.what = "image samples of an unknown kind, expected 8 or 16 bits a band", .file = name};
    }
    build_coarser_levels(texture);
    return texture;
}

/// Whether a JPEG has no end-of-image marker: the decoder would fill the missing part with grey. Segments (ITU-T
/// T.81, B.1) before the first scan are skipped by their length, as they may hold a thumbnail; after that the
/// marker can only be the file's own.
bool is_jpeg_cut_short(std::span<const std::uint8_t> bytes) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (!text.starts_with("\xFF\xD8\xFF")) return false;
    std::size_t at = 2;
    while (at + 4 <= text.size() && text[at] == '\xFF' && text[at + 1] != '\xDA')
        at += 2 + 256U * bytes[at + 2] + bytes[at + 3];
    return text.find("\xFF\xD9", at) == text.npos;
}

}  // namespace

Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes,
                               const TextureUse& use) {
    const Error no_image{.what = "not an image that can be read, expected PNG, JPEG, TIFF, WebP, BMP or PNM",
                         .file = name};
    try {
        if (bytes.empty()) return Error{.what = "empty file, expected an image", .file = name};
        const std::optional<ImageSize> size = image_size(bytes);
        if (!size) return no_image;
        if (size->width > kMaxPixels || size->height > kMaxPixels / size->width)
            return Error{.what = fmt::format("an image of {} x {} pixels, expected at most {} of them", size->width,
                                             size->height, kMaxPixels),
                         .file = name};
        if (is_jpeg_cut_short(bytes)) return Error{.what = "a JPEG without an end: it is cut short", .file = name};
        const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<std::uint8_t*>(bytes.data()));
        const Result<ImageCodecs> codecs = image_codecs(name);
        if (!codecs) return codecs.error();
        const cv::Mat bgr =
            codecs->imdecode(raw, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
        if (bgr.empty()) return no_image;
        return from_image(name, bgr, use);
    } catch (const std::exception& e) {
        return Error{.what = std::string("image cannot be decoded: ") + e.what(), .file = name};
    }
}

Result<Texture> read_texture(const std::string& path, const TextureUse& use) {
    Result<std::string> bytes = read_file(path);
    if (!bytes) return bytes.error();
    return decode_texture(path, {reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()}, use);
}

}  // namespace narpa
