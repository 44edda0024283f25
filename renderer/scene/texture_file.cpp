#include "renderer/scene/texture_file.h"

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "renderer/scene/file_bytes.h"

namespace narpa {

namespace {

/// sRGB code value -> linear, 65535 = 1.0.
std::array<std::uint16_t, 256> linear_from_srgb() {
    std::array<std::uint16_t, 256> table{};
    for (std::size_t i = 0; i < table.size(); ++i) {
        const double s = static_cast<double>(i) / 255.0;
        const double linear = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
        table[i] = static_cast<std::uint16_t>(std::lround(65535.0 * linear));
    }
    return table;
}

/// OpenCV keeps blue first.
template <class Sample, class Convert>
void copy_rgb(const cv::Mat& bgr, std::uint16_t* out, Convert convert) {
    for (int y = 0; y < bgr.rows; ++y) {
        const Sample* in = bgr.ptr<Sample>(y);
        for (int x = 0; x < bgr.cols; ++x, in += 3, out += 3) {
            out[0] = convert(in[2]);
            out[1] = convert(in[1]);
            out[2] = convert(in[0]);
        }
    }
}

Result<Texture> from_image(const std::string& name, const cv::Mat& bgr) {
    Texture texture{.name = name, .width = bgr.cols, .height = bgr.rows, .rgb = {}};
    texture.rgb.resize(3 * bgr.total());
    if (bgr.type() == CV_8UC3) {
        static const std::array<std::uint16_t, 256> linear = linear_from_srgb();
        copy_rgb<std::uint8_t>(bgr, texture.rgb.data(), [](std::uint8_t s) { return linear[s]; });
    } else if (bgr.type() == CV_16UC3) {
        copy_rgb<std::uint16_t>(bgr, texture.rgb.data(), [](std::uint16_t s) { return s; });
    } else {
        return Error{.what = "image samples of an unknown kind, expected 8 or 16 bits a band", .file = name};
    }
    return texture;
}

}  // namespace

Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes) {
    try {
        if (bytes.empty()) return Error{.what = "empty file, expected an image", .file = name};
        const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<std::uint8_t*>(bytes.data()));
        const cv::Mat bgr =
            cv::imdecode(raw, cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
        if (bgr.empty())
            return Error{.what = "not an image that can be read, expected PNG, JPEG, TIFF ...", .file = name};
        return from_image(name, bgr);
    } catch (const std::exception& e) {
        return Error{.what = std::string("image cannot be decoded: ") + e.what(), .file = name};
    }
}

Result<Texture> read_texture(const std::string& path) {
    Result<std::string> bytes = read_file(path);
    if (!bytes) return bytes.error();
    return decode_texture(path, {reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()});
}

}  // namespace narpa
