/// renderer/detector/pixel_bytes.h - DN of kLanes pixels -> the bytes of a pixel format.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "base/lanes.h"
#include "base/pixel_format.h"

namespace narpa {

using DnLanes = Lanes<std::uint32_t>;

/// DN of each photosite of kLanes pixels; formats with one photosite per pixel use dn[0] only.
struct alignas(64) DnBands {
    std::array<DnLanes, 3> dn;
};

// Bytes are gathered in local arrays and copied out: a pointer to bytes may alias anything, which prevents
// vectorisation.
static_assert(std::endian::native == std::endian::little);

inline Lanes<std::uint8_t> to_grey(int bits, const DnLanes& dn) noexcept {
    Lanes<std::uint8_t> out;
    for (std::size_t i = 0; i < kLanes; ++i) out[i] = static_cast<std::uint8_t>(dn[i] >> (bits - 8));
    return out;
}
inline Lanes<std::uint16_t> to_y16(int bits, const DnLanes& dn) noexcept {
    Lanes<std::uint16_t> out;
    for (std::size_t i = 0; i < kLanes; ++i) out[i] = static_cast<std::uint16_t>(dn[i] << (16 - bits));
    return out;
}
inline std::array<std::uint8_t, 3 * kLanes> to_rgb24(int bits, const DnBands& c) noexcept {
    std::array<std::uint8_t, 3 * kLanes> out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        out[3 * i] = static_cast<std::uint8_t>(c.dn[0][i] >> (bits - 8));
        out[3 * i + 1] = static_cast<std::uint8_t>(c.dn[1][i] >> (bits - 8));
        out[3 * i + 2] = static_cast<std::uint8_t>(c.dn[2][i] >> (bits - 8));
    }
    return out;
}

/// ITU-R BT.601, 8 bits: luma 16..235 = 16 + (65.481 R + 128.553 G + 24.966 B) / 255; chroma 16..240 = 128 +
/// (-37.797 R - 74.203 G + 112 B) / 255 and 128 + (112 R - 93.786 G - 18.214 B) / 255 of the mean of a pair. All in
/// thousandths, so that rounding is exact.
inline std::array<std::uint32_t, kLanes / 2> to_yuyv(int bits, const DnBands& c) noexcept {
    constexpr std::uint32_t kLuma = 255'000, kChroma = 2 * kLuma;  // of each pixel, of a pair
    constexpr std::uint32_t kLumaHalfUp = 33 * (kLuma / 2), kChromaHalfUp = 257 * (kChroma / 2);
    DnLanes y, u, v;  // u and v wrap below zero until the pair's offset is added
    for (std::size_t i = 0; i < kLanes; ++i) {
        const std::uint32_t r = c.dn[0][i] >> (bits - 8), g = c.dn[1][i] >> (bits - 8),
                            b = c.dn[2][i] >> (bits - 8);
        y[i] = (65'481 * r + 128'553 * g + 24'966 * b + kLumaHalfUp) / kLuma;
        u[i] = 112'000 * b - 37'797 * r - 74'203 * g;
        v[i] = 112'000 * r - 93'786 * g - 18'214 * b;
    }
    std::array<std::uint32_t, kLanes / 2> out;
    for (std::size_t i = 0; i < kLanes / 2; ++i) {
        const std::uint32_t u_of_pair = (u[2 * i] + u[2 * i + 1] + kChromaHalfUp) / kChroma,
                            v_of_pair = (v[2 * i] + v[2 * i + 1] + kChromaHalfUp) / kChroma;
        out[i] = y[2 * i] | u_of_pair << 8 | y[2 * i + 1] << 16 | v_of_pair << 24;
    }
    return out;
}

/// The format of a mosaic's samples: GREY or Y16; of other formats, the format itself.
inline PixelFormat sample_format(PixelFormat f) noexcept {
    return !is_bayer(f) ? f : is_16_bit(f) ? PixelFormat::y16 : PixelFormat::grey;
}

/// kLanes pixels as bytes of a format without a mosaic.
inline void put_lanes(int bits, PixelFormat format, const DnBands& c, std::uint8_t* out) noexcept {
    const auto put = [out](const auto& bytes) { std::memcpy(out, bytes.data(), sizeof bytes); };
    switch (format) {
        case PixelFormat::grey: return put(to_grey(bits, c.dn[0]));
        case PixelFormat::y16: return put(to_y16(bits, c.dn[0]));
        case PixelFormat::rgb24: return put(to_rgb24(bits, c));
        case PixelFormat::yuyv: return put(to_yuyv(bits, c));
        default: return;
    }
}

}  // namespace narpa
