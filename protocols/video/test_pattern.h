/// protocols/video/test_pattern.h - frames of known pixels, as image sensors send them to test a link: any receiver
/// can compute them (README.md).
#pragma once

#include <cstdint>
#include <span>

#include "base/pixel_format.h"

namespace narpa {

/// Of a format's samples: those of 16 bits hold `bits` of the ADC, left-justified; of other formats each byte is a
/// sample of 8 bits. `out`: frame_bytes of the format.

/// Sample i of frame k is (i + k) modulo 2^bits.
void fill_counter(PixelFormat format, int bits, std::uint32_t frame, std::span<std::uint8_t> out) noexcept;
/// The pseudo-random sequence of x^23 + x^18 + 1 (ITU-T O.150), `bits` of it a sample, the first one highest. The
/// register begins frame k with 2^23 - 1 - k modulo 2^22.
void fill_prbs(PixelFormat format, int bits, std::uint32_t frame, std::span<std::uint8_t> out) noexcept;

}  // namespace narpa
