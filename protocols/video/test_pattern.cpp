#include "protocols/video/test_pattern.h"

#include "protocols/little_endian.h"

namespace narpa {
namespace {

/// `next`: the next sample, of `bits`.
void fill_samples(PixelFormat format, int bits, std::span<std::uint8_t> out, auto next) noexcept {
    if (!is_16_bit(format)) {
        for (std::uint8_t& byte : out) byte = static_cast<std::uint8_t>(next());
        return;
    }
    for (std::size_t i = 0; i + 1 < out.size(); i += 2)
        put_le(&out[i], static_cast<std::uint16_t>(next() << (16 - bits)));
}

}  // namespace

void fill_counter(PixelFormat format, int bits, std::uint32_t frame, std::span<std::uint8_t> out) noexcept {
    const std::uint32_t mask = (1u << (is_16_bit(format) ? bits : 8)) - 1;
    fill_samples(format, bits, out, [&, value = frame]() mutable { return value++ & mask; });
}

void fill_prbs(PixelFormat format, int bits, std::uint32_t frame, std::span<std::uint8_t> out) noexcept {
    constexpr std::uint32_t kRegister = (1u << 23) - 1;
    const int n = is_16_bit(format) ? bits : 8;
    fill_samples(format, bits, out, [n, state = kRegister - frame % (1u << 22)]() mutable {
        std::uint32_t sample = 0;
        for (int i = 0; i < n; ++i) {
            const std::uint32_t bit = (state >> 22 ^ state >> 17) & 1;
            state = (state << 1 | bit) & kRegister;
            sample = sample << 1 | bit;
        }
        return sample;
    });
}

}  // namespace narpa
