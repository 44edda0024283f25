#include "protocols/video/link_layout.h"

#include <algorithm>

#include "protocols/little_endian.h"

namespace narpa {
namespace {

/// Left-justified, in 16 bits.
unsigned sample_at(const std::uint8_t* samples, std::size_t pixel) {
    return get_le<std::uint16_t>(&samples[2 * pixel]);
}
void put_sample(std::uint8_t* samples, std::size_t pixel, unsigned value) {
    put_le(&samples[2 * pixel], static_cast<std::uint16_t>(value));
}

using Row = std::span<const std::uint8_t>;

/// Elements of 16 bits, right-justified where `bits` is less.
void right_justify(Row samples, const LinkLayout& link, std::uint8_t* out) {
    const std::size_t low = link.big_endian ? 1 : 0;
    for (std::size_t i = 0; i < samples.size() / 2; ++i) {
        const unsigned value = sample_at(samples.data(), i) >> (16 - link.bits);
        out[2 * i + low] = static_cast<std::uint8_t>(value);
        out[2 * i + 1 - low] = static_cast<std::uint8_t>(value >> 8);
    }
}
void left_justify(Row bytes, const LinkLayout& link, std::uint8_t* samples) {
    const std::size_t low = link.big_endian ? 1 : 0;
    for (std::size_t i = 0; i < bytes.size() / 2; ++i) {
        const unsigned value = bytes[2 * i + low] | unsigned{bytes[2 * i + 1 - low]} << 8;
        put_sample(samples, i, value << (16 - link.bits) & 0xFFFF);
    }
}

/// Groups of kPixels pixels of 8 + 8 / kPixels bits: the high bytes, then the low bits, those of the first pixel
/// lowest.
template <std::size_t kPixels>
void pack_mipi(Row samples, std::uint8_t* out) {
    constexpr unsigned kLowBits = 8 / kPixels;
    for (std::size_t first = 0; first < samples.size() / 2; first += kPixels, out += kPixels + 1) {
        unsigned low = 0;
        for (std::size_t i = 0; i < kPixels; ++i) {
            const unsigned sample = sample_at(samples.data(), first + i);
            out[i] = static_cast<std::uint8_t>(sample >> 8);
            low |= (sample >> (8 - kLowBits) & ((1u << kLowBits) - 1)) << (kLowBits * i);
        }
        out[kPixels] = static_cast<std::uint8_t>(low);
    }
}
template <std::size_t kPixels>
void unpack_mipi(Row bytes, std::uint8_t* samples) {
    constexpr unsigned kLowBits = 8 / kPixels;
    std::size_t pixel = 0;
    for (const std::uint8_t* in = bytes.data(); in != bytes.data() + bytes.size(); in += kPixels + 1)
        for (std::size_t i = 0; i < kPixels; ++i, ++pixel) {
            const unsigned low = static_cast<unsigned>(in[kPixels]) >> (kLowBits * i) & ((1u << kLowBits) - 1);
            put_sample(samples, pixel, static_cast<unsigned>(in[i]) << 8 | low << (8 - kLowBits));
        }
}

/// Groups of kPixels pixels of 8 + 8 / kPixels bits: one number, its bytes from the lowest on.
template <std::size_t kPixels>
void pack_genicam(Row samples, std::uint8_t* out) {
    constexpr unsigned kBits = 8 + 8 / kPixels;
    for (std::size_t first = 0; first < samples.size() / 2; first += kPixels) {
        std::uint64_t group = 0;
        for (std::size_t i = 0; i < kPixels; ++i)
            group |= std::uint64_t{sample_at(samples.data(), first + i) >> (16 - kBits)} << (kBits * i);
        for (std::size_t i = 0; i <= kPixels; ++i) *out++ = static_cast<std::uint8_t>(group >> (8 * i));
    }
}
template <std::size_t kPixels>
void unpack_genicam(Row bytes, std::uint8_t* samples) {
    constexpr unsigned kBits = 8 + 8 / kPixels;
    std::size_t pixel = 0;
    for (const std::uint8_t* in = bytes.data(); in != bytes.data() + bytes.size(); in += kPixels + 1) {
        std::uint64_t group = 0;
        for (std::size_t i = 0; i <= kPixels; ++i) group |= std::uint64_t{in[i]} << (8 * i);
        for (std::size_t i = 0; i < kPixels; ++i, ++pixel)
            put_sample(samples, pixel, static_cast<unsigned>(group >> (kBits * i)) << (16 - kBits) & 0xFFFF);
    }
}

void lay_out_row(const LinkLayout& link, Row samples, std::uint8_t* out) {
    switch (link.kind) {
        case LinkLayout::Kind::samples:
            if (!link.big_endian) {
                std::ranges::copy(samples, out);
                break;
            }
            [[fallthrough]];
        case LinkLayout::Kind::right: right_justify(samples, link, out); break;
        case LinkLayout::Kind::mipi:
            link.bits == 10 ? pack_mipi<4>(samples, out) : pack_mipi<2>(samples, out);
            break;
        case LinkLayout::Kind::genicam:
            link.bits == 10 ? pack_genicam<4>(samples, out) : pack_genicam<2>(samples, out);
            break;
    }
}
void samples_of_row(const LinkLayout& link, Row bytes, std::uint8_t* samples) {
    switch (link.kind) {
        case LinkLayout::Kind::samples:
            if (!link.big_endian) {
                std::ranges::copy(bytes, samples);
                break;
            }
            [[fallthrough]];
        case LinkLayout::Kind::right: left_justify(bytes, link, samples); break;
        case LinkLayout::Kind::mipi:
            link.bits == 10 ? unpack_mipi<4>(bytes, samples) : unpack_mipi<2>(bytes, samples);
            break;
        case LinkLayout::Kind::genicam:
            link.bits == 10 ? unpack_genicam<4>(bytes, samples) : unpack_genicam<2>(bytes, samples);
            break;
    }
}

struct RowSizes {
    std::size_t samples, pixels, link;  ///< bytes of a row: of samples, on the link without and with padding
};
RowSizes row_sizes(const VideoFormat& f) {
    const auto width = static_cast<std::size_t>(f.width);
    return {width * bytes_per_pixel(f.pixel), link_pixel_bytes(width, f.pixel, f.link), link_row_bytes(f)};
}

/// The embedded line, from one last row to another.
void keep_first_bytes(const LinkLayout& link, Row from, std::span<std::uint8_t> to) {
    const std::size_t n = std::min({std::size_t{link.first_bytes_kept}, from.size(), to.size()});
    std::copy_n(from.begin(), n, to.begin());
}

}  // namespace

void lay_out(const VideoFormat& f, std::span<const std::uint8_t> samples, std::span<std::uint8_t> out) noexcept {
    const RowSizes size = row_sizes(f);
    for (std::size_t y = 0; y < static_cast<std::size_t>(f.height); ++y) {
        const auto row = out.subspan(y * size.link, size.link);
        lay_out_row(f.link, samples.subspan(y * size.samples, size.samples), row.data());
        std::ranges::fill(row.subspan(size.pixels), std::uint8_t{0});
    }
    keep_first_bytes(f.link, samples.last(size.samples), out.last(size.link));
}

void samples_of_link(const VideoFormat& f, std::span<const std::uint8_t> bytes,
                     std::span<std::uint8_t> samples) noexcept {
    const RowSizes size = row_sizes(f);
    for (std::size_t y = 0; y < static_cast<std::size_t>(f.height); ++y)
        samples_of_row(f.link, bytes.subspan(y * size.link, size.pixels), &samples[y * size.samples]);
    keep_first_bytes(f.link, bytes.last(size.link), samples.last(size.samples));
}

}  // namespace narpa
