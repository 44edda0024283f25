#include "renderer/assets/images/texture_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/file_bytes.h"
#include "renderer/material/texture/texture_lookup.h"

namespace narpa {

double linear_from_srgb(double s) {
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

namespace {

using Colour = TextureUse::Colour;
using Kind = TransferCurve::Kind;

/// Lookup table from code to linear light, 65535 = 1.0.
using Table = std::vector<std::uint16_t>;

template <class Curve>
Table table_of(std::uint32_t largest, Curve linear) {
    Table table;
    for (std::uint32_t code = 0; code <= largest; ++code)
        table.push_back(
            static_cast<std::uint16_t>(std::lround(65535.0 * linear(code / static_cast<double>(largest)))));
    return table;
}

double from_middle_at_128(double s) {
    const double code = 255 * s;
    return code <= 128 ? code / 256 : 0.5 + (code - 128) / 254;
}

TransferCurve curve_for(const DecodedImage& image, Colour colour) {
    switch (colour) {
        case Colour::srgb: return {Kind::srgb};
        case Colour::linear:
        case Colour::normals: return {Kind::power, 1};
        case Colour::by_depth: break;
    }
    if (image.transfer.kind != Kind::unspecified) return image.transfer;
    return image.samples.empty() || image.largest > 255 ? TransferCurve{Kind::power, 1} : TransferCurve{Kind::srgb};
}

Table table_for(const DecodedImage& image, Colour colour) {
    if (colour == Colour::normals && image.largest == 255) return table_of(255, from_middle_at_128);
    const TransferCurve curve = curve_for(image, colour);
    if (curve.kind == Kind::srgb) return table_of(image.largest, linear_from_srgb);
    if (curve.exponent == 1) return table_of(image.largest, [](double s) { return s; });
    return table_of(image.largest, [&](double s) { return std::pow(s, curve.exponent); });
}

std::string words_of(const TransferCurve& curve) {
    if (curve.kind == Kind::srgb) return "sRGB";
    return curve.exponent == 1 ? "linear light" : fmt::format("a gamma of {:.5g}", 1 / curve.exponent);
}

/// Whether two curves differ by no more than sRGB and the gamma of 0.45455 that stands for it.
bool are_alike(const TransferCurve& a, const TransferCurve& b) {
    const auto exponent = [](const TransferCurve& c) { return c.kind == Kind::srgb ? 2.2 : c.exponent; };
    return std::abs(exponent(a) - exponent(b)) < 0.01;
}

void warn(const std::string& name, const DecodedImage& image, Colour colour, std::vector<std::string>& warnings) {
    for (const std::string& what : image.unused) warnings.push_back(name + ": " + what);
    const TransferCurve used = curve_for(image, colour);
    if (image.transfer.kind != Kind::unspecified && !are_alike(used, image.transfer))
        warnings.push_back(
            fmt::format("{}: it declares {}, and is read as {} as the scene or the kind of texture asks", name,
                        words_of(image.transfer), words_of(used)));
}

/// Integers of full scale 65535 from floats.
Status quantize(const std::string& name, DecodedImage& image) {
    for (const float x : image.floats)
        if (!(x >= 0 && x <= 1))
            return Error{
                .what = fmt::format("has a floating-point sample of {}, expected 0 to 1: gdal_translate -ot "
                                    "UInt16 -scale converts it",
                                    x),
                .file = name};
    std::ranges::transform(image.floats, std::back_inserter(image.samples), [](float x) {
        return static_cast<std::uint16_t>(std::lround(65535 * static_cast<double>(x)));
    });
    image.largest = 65535;
    return Ok{};
}

Result<Texture> from_image(const std::string& name, DecodedImage& image, const TextureUse& use) {
    const Table linear = table_for(image, use.colour);
    if (image.samples.empty())
        if (const Status good = quantize(name, image); !good) return good.error();
    Texture texture{.name = name, .width = image.width, .height = image.height, .rgb = {}, .wrap = use.wrap};
    const int copies = image.channels == 1 ? 3 : 1;
    texture.rgb.resize(static_cast<std::size_t>(copies) * image.samples.size());
    std::uint16_t* out = texture.rgb.data();
    for (const std::uint16_t sample : image.samples) out = std::fill_n(out, copies, linear[sample]);
    image = {};  // the mipmaps take its memory
    build_coarser_levels(texture);
    return texture;
}

}  // namespace

Result<Texture> decode_texture(const std::string& name, std::span<const std::uint8_t> bytes, const TextureUse& use,
                               std::vector<std::string>* warnings) {
    try {
        Result<DecodedImage> image = decode_image(name, bytes);
        if (!image) return image.error();
        if (warnings != nullptr) warn(name, *image, use.colour, *warnings);
        return from_image(name, *image, use);
    } catch (const std::exception& e) {  // no memory
        return Error{.what = std::string("image cannot be decoded: ") + e.what(), .file = name};
    }
}

Result<Texture> read_texture(const std::string& path, const TextureUse& use, std::vector<std::string>* warnings) {
    Result<std::string> bytes = read_file(path);
    if (!bytes) return bytes.error();
    return decode_texture(path, {reinterpret_cast<const std::uint8_t*>(bytes->data()), bytes->size()}, use,
                          warnings);
}

}  // namespace narpa
