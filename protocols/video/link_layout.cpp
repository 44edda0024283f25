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

void right_justify(std::span<const std::uint8_t> samples, int bits, std::uint8_t* out) {
    for (std::size_t i = 0; i < samples.size() / 2; ++i)
        put_sample(out, i, sample_at(samples.data(), i) >> (16 - bits));
}
void left_justify(std::span<const std::uint8_t> bytes, int bits, std::uint8_t* samples) {
    for (std::size_t i = 0; i < bytes.size() / 2; ++i)
        put_sample(samples, i, sample_at(bytes.data(), i) << (16 - bits) & 0xFFFF);
}

/// Groups of kPixels pixels of 8 + 8 / kPixels bits: the high bytes, then the low bits, those of the first pixel
/// lowest.
template <std::size_t kPixels>
void pack(std::span<const std::uint8_t> samples, std::uint8_t* out) {
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
void unpack(std::span<const std::uint8_t> bytes, std::uint8_t* samples) {
    constexpr unsigned kLowBits = 8 / kPixels;
    std::size_t pixel = 0;
    for (const std::uint8_t* in = bytes.data(); in != bytes.data() + bytes.size(); in += kPixels + 1)
        for (std::size_t i = 0; i < kPixels; ++i, ++pixel) {
            const unsigned low = static_cast<unsigned>(in[kPixels]) >> (kLowBits * i) & ((1u << kLowBits) - 1);
            put_sample(samples, pixel, static_cast<unsigned>(in[i]) << 8 | low << (8 - kLowBits));
        }
}

/// The embedded line, from one last row to another.
void keep_first_bytes(const VideoFormat& f, std::span<const std::uint8_t> from, std::size_t from_row,
                      std::span<std::uint8_t> to, std::size_t to_row) {
    const std::size_t n = std::min({std::size_t{f.link.first_bytes_kept}, from_row, to_row});
    std::copy_n(from.last(from_row).begin(), n, to.last(to_row).begin());
}

}  // namespace

void lay_out(const VideoFormat& f, std::span<const std::uint8_t> samples, std::span<std::uint8_t> out) noexcept {
    switch (f.link.kind) {
        case LinkLayout::Kind::samples: std::ranges::copy(samples, out.begin()); return;
        case LinkLayout::Kind::right: right_justify(samples, f.link.bits, out.data()); break;
        case LinkLayout::Kind::mipi:
            f.link.bits == 10 ? pack<4>(samples, out.data()) : pack<2>(samples, out.data());
            break;
    }
    keep_first_bytes(f, samples, frame_bytes(f) / static_cast<std::size_t>(f.height), out, link_row_bytes(f));
}

void samples_of_link(const VideoFormat& f, std::span<const std::uint8_t> bytes,
                     std::span<std::uint8_t> samples) noexcept {
    switch (f.link.kind) {
        case LinkLayout::Kind::samples: std::ranges::copy(bytes, samples.begin()); return;
        case LinkLayout::Kind::right: left_justify(bytes, f.link.bits, samples.data()); break;
        case LinkLayout::Kind::mipi:
            f.link.bits == 10 ? unpack<4>(bytes, samples.data()) : unpack<2>(bytes, samples.data());
            break;
    }
    keep_first_bytes(f, bytes, link_row_bytes(f), samples, frame_bytes(f) / static_cast<std::size_t>(f.height));
}

}  // namespace narpa
