#include "renderer/assets/images/image_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string_view>

#include "renderer/assets/images/image_codecs.h"
#include "renderer/assets/images/image_header.h"

namespace narpa {
namespace {

constexpr const char* kExpected = "expected PNG, JPEG, TIFF, WebP, BMP, PNM or PAM";
constexpr const char* kDamaged = "cannot be decoded: it is damaged, or cut short";

/// Whether a JPEG has no end-of-image marker: the decoder would fill the missing part with grey. Segments (ITU-T
/// T.81, B.1) before the first scan are skipped by their length, as they may hold a thumbnail; after that the
/// marker can only be the file's own.
bool is_jpeg_cut_short(std::span<const std::uint8_t> bytes) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    std::size_t at = 2;
    while (at + 4 <= text.size() && text[at] == '\xFF' && text[at + 1] != '\xDA')
        at += 2 + 256U * bytes[at + 2] + bytes[at + 3];
    return text.find("\xFF\xD9", at) == text.npos;
}

/// OpenCV stores blue first.
template <class Sample>
void copy_samples(const cv::Mat& image, std::uint16_t* out) {
    const bool is_grey = image.channels() == 1;
    for (int y = 0; y < image.rows; ++y) {
        const Sample* in = image.ptr<Sample>(y);
        if (is_grey) {
            out = std::copy_n(in, image.cols, out);
            continue;
        }
        for (int x = 0; x < image.cols; ++x, in += 3) *out++ = in[2], *out++ = in[1], *out++ = in[0];
    }
}

Result<DecodedImage> decode_with_opencv(const ImageCodecs& codecs, std::span<const std::uint8_t> bytes) {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<std::uint8_t*>(bytes.data()));
    cv::Mat image;
    try {
        image = codecs.imdecode(raw, cv::IMREAD_ANYCOLOR | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
    } catch (const std::exception& e) {
        return Error{fmt::format("{}: {}", kDamaged, e.what())};
    }
    if (image.empty()) return Error{kDamaged};
    DecodedImage out{.width = image.cols, .height = image.rows, .channels = image.channels()};
    out.samples.resize(image.total() * static_cast<std::size_t>(image.channels()));
    if ((image.channels() != 1 && image.channels() != 3) || (image.depth() != CV_8U && image.depth() != CV_16U))
        return Error{"has samples of an unknown kind, expected 8 or 16 bits, grey or colours"};
    out.largest = image.depth() == CV_8U ? 255 : 65535;
    image.depth() == CV_8U ? copy_samples<std::uint8_t>(image, out.samples.data())
                           : copy_samples<std::uint16_t>(image, out.samples.data());
    return out;
}

/// A decimal number after spaces and comments, which go from # to the end of the line; nothing at the end.
std::optional<std::uint32_t> next_number(std::string_view text, std::size_t& at) {
    while (at < text.size() && (std::isspace(static_cast<unsigned char>(text[at])) != 0 || text[at] == '#'))
        at = text[at] == '#' ? std::min(text.find('\n', at), text.size()) : at + 1;
    std::uint32_t number = 0;
    const auto [end, problem] = std::from_chars(text.data() + at, text.data() + text.size(), number);
    if (problem != std::errc()) return std::nullopt;
    at = static_cast<std::size_t>(end - text.data());
    return number;
}

/// Netpbm's samples of numbers, after the header: decimal, or one byte each, or two with the higher first. Not by
/// OpenCV, which scales some and not others.
Result<DecodedImage> decode_netpbm(const ImageHeader& h, std::span<const std::uint8_t> bytes) {
    const auto depth = static_cast<std::size_t>(h.channels);
    const std::size_t size = h.largest > 255 ? 2 : 1, count = h.width * h.height * depth,
                      data = std::min(bytes.size(), h.data);
    if ((bytes.size() - data) / (h.is_text ? 1 : size) < (h.is_text ? count / 2 : count)) return Error{kDamaged};
    DecodedImage out{.width = static_cast<int>(h.width),
                     .height = static_cast<int>(h.height),
                     .channels = depth - h.has_alpha >= 3 ? 3 : 1,
                     .has_alpha = h.has_alpha,
                     .largest = h.largest};
    out.samples.reserve(h.width * h.height * static_cast<std::size_t>(out.channels));
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    std::size_t at = data;
    for (std::size_t i = 0; i < count; ++i) {
        std::optional<std::uint32_t> sample;
        if (h.is_text) {
            sample = next_number(text, at);
            if (!sample) return Error{kDamaged};
        } else {
            sample = size == 1 ? bytes[at] : static_cast<std::uint32_t>(bytes[at] << 8 | bytes[at + 1]);
            at += size;
        }
        if (*sample > h.largest)
            return Error{fmt::format("has a sample of {}, expected at most its maxval, {}", *sample, h.largest)};
        if (i % depth < static_cast<std::size_t>(out.channels))
            out.samples.push_back(static_cast<std::uint16_t>(*sample));
    }
    return out;
}

/// PNG's sBIT: samples of fewer bits, which an encoder scales to the full range (PNG, 12.4). Some fill the lower
/// bits with zeros: these are scaled here. Others leave the upper bits empty, which the standard rules out.
void use_significant_bits(const std::array<int, 3>& declared, DecodedImage& image) {
    const int depth = image.largest == 255 ? 8 : 16;
    const auto channels = static_cast<std::size_t>(image.channels);
    for (std::size_t c = 0; c < channels; ++c) {
        const int bits = declared[c];
        image.significant_bits = std::max(image.significant_bits, bits);
        if (bits == 0 || bits >= depth) continue;
        const int low = depth - bits;
        const auto scaled = [&](std::uint16_t v) {
            return static_cast<int>(
                std::lround((v >> low) * static_cast<double>(image.largest) / ((1 << bits) - 1)));
        };
        bool is_scaled = true, is_filled_with_zeros = true, is_small = true;
        for (std::size_t i = c; i < image.samples.size(); i += channels) {
            const std::uint16_t v = image.samples[i];
            is_scaled = is_scaled && std::abs(scaled(v) - v) <= 1;
            is_filled_with_zeros = is_filled_with_zeros && (v & ((1 << low) - 1)) == 0;
            is_small = is_small && v < 1 << bits;
        }
        if (is_scaled) continue;
        if (is_filled_with_zeros) {
            for (std::size_t i = c; i < image.samples.size(); i += channels)
                image.samples[i] = static_cast<std::uint16_t>(scaled(image.samples[i]));
            continue;
        }
        image.unused.push_back(
            is_small ? fmt::format("its {} significant bits of {} (sBIT) are not used: all samples are below {}, "
                                   "and {} is read as 1",
                                   bits, depth, 1 << bits, image.largest)
                     : fmt::format("its {} significant bits of {} (sBIT) are not used: the samples have more", bits,
                                   depth));
        return;
    }
}

void use_profile(DecodedImage& image) {
    if (image.icc_profile.empty()) return;
    if (is_srgb_profile(image.icc_profile))
        image.transfer = {TransferCurve::Kind::srgb};
    else
        image.unused.emplace_back("its ICC profile is not used");
    image.icc_profile.clear();
}

/// What the decoders pass over. libtiff's passes over no more than the profile.
void use_declarations(const ImageHeader& h, DecodedImage& image) {
    if (h.format == ImageHeader::Format::tiff) return use_profile(image);
    image.has_alpha = h.has_alpha;
    if (h.is_grey && image.channels == 3) {  // OpenCV makes colours of grey with alpha
        image.channels = 1;
        for (std::size_t i = 0; i < image.samples.size() / 3; ++i) image.samples[i] = image.samples[3 * i];
        image.samples.resize(image.samples.size() / 3);
    }
    image.transfer = h.transfer;
    image.unused.insert(image.unused.end(), h.unused.begin(), h.unused.end());
    if (h.format == ImageHeader::Format::png) use_significant_bits(h.significant_bits, image);
}

Result<DecodedImage> decode_known(const std::string& name, const ImageHeader& h,
                                  std::span<const std::uint8_t> bytes) {
    if (h.channels > 0) return decode_netpbm(h, bytes);
    const Result<ImageCodecs> codecs = image_codecs(name);
    if (!codecs) return codecs.error();
    if (h.format == ImageHeader::Format::tiff) return codecs->decode_tiff(bytes);
    return decode_with_opencv(*codecs, bytes);
}

}  // namespace

Result<DecodedImage> decode_image(const std::string& name, std::span<const std::uint8_t> bytes) {
    const auto refuse = [&](std::string what) { return Error{.what = std::move(what), .file = name}; };
    if (bytes.empty()) return refuse("is no image that can be decoded: an empty file");
    const std::optional<ImageHeader> header = image_header(bytes);
    if (!header) {
        const std::string other = name_of_other_format(bytes);
        return refuse(other.empty() ? fmt::format("is no image that can be decoded, {}", kExpected)
                                    : fmt::format("has the format {}, {}", other, kExpected));
    }
    if (!header->refusal.empty()) return refuse("is " + header->refusal);
    if (header->width > kMaxPixels || header->height > kMaxPixels / header->width)
        return refuse(fmt::format("an image of {} x {} pixels, expected at most {} of them", header->width,
                                  header->height, kMaxPixels));
    if (header->width > kMaxSide || header->height > kMaxSide)
        return refuse(fmt::format("an image of {} x {} pixels, expected at most {} in each direction",
                                  header->width, header->height, kMaxSide));
    if (header->format == ImageHeader::Format::jpeg && is_jpeg_cut_short(bytes))
        return refuse("a JPEG without an end: it is cut short");
    Result<DecodedImage> image = [&]() -> Result<DecodedImage> {
        try {
            return decode_known(name, *header, bytes);
        } catch (const std::exception& e) {  // no memory
            return Error{std::string("cannot be decoded: ") + e.what()};
        }
    }();
    if (image) use_declarations(*header, *image);
    if (image) return image;
    Error error = std::move(image.error());
    error.file = name;
    return error;
}

}  // namespace narpa
