/// base/fast_math.h - sine, cosine, logarithm and powers without branches or tables, so that the compiler can
/// vectorise them. A value is the same in a vector lane as in scalar code.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace narpa {

struct SinCos {
    double sin, cos;
};
/// Sine and cosine of 2 pi * turns, |turns| < 2^49: absolute error below 4e-16. Taylor series about the nearest
/// quarter turn, where |angle| <= pi / 4.
[[nodiscard]] inline SinCos sincos_of_turns(double turns) noexcept {
    constexpr double kToInteger = 0x1.8p52;  // adding it puts the nearest integer into the lowest bits
    const double shifted = 4 * turns + kToInteger;
    const auto quarter = std::bit_cast<std::uint64_t>(shifted);
    const double x = 2 * std::numbers::pi * (turns - 0.25 * (shifted - kToInteger)), y = x * x;
    const double s =
        x + x * y *
                (-1.0 / 6 +
                 y * (1.0 / 120 +
                      y * (-1.0 / 5040 + y * (1.0 / 362880 + y * (-1.0 / 39916800 +
                                                                  y * (1.0 / 6227020800 - y / 1307674368000))))));
    const double c =
        1 + y * (-1.0 / 2 +
                 y * (1.0 / 24 + y * (-1.0 / 720 +
                                      y * (1.0 / 40320 + y * (-1.0 / 3628800 +
                                                              y * (1.0 / 479001600 + y * (-1.0 / 87178291200 +
                                                                                          y / 20922789888000)))))));
    const std::uint64_t swap = -(quarter & 1);
    const auto s_bits = std::bit_cast<std::uint64_t>(s), c_bits = std::bit_cast<std::uint64_t>(c);
    const std::uint64_t s_sign = (quarter & 2) << 62, c_sign = ((quarter + 1) & 2) << 62;
    return {std::bit_cast<double>(((s_bits & ~swap) | (c_bits & swap)) ^ s_sign),
            std::bit_cast<double>(((c_bits & ~swap) | (s_bits & swap)) ^ c_sign)};
}

/// x^n for 0 < x <= 1, normal, and n >= 0, to a relative error below 1e-9 for n up to 1e5; 0 below 1e-300.
[[nodiscard]] inline double unit_power(double x, double n) noexcept {
    // x = m 2^e, sqrt(1/2) <= m < sqrt(2); ln m by the series of the inverse hyperbolic tangent.
    constexpr std::uint64_t kRootHalf = 0x3fe6a09e667f3bcd;
    const std::uint64_t bits = std::bit_cast<std::uint64_t>(x), above = bits - kRootHalf;
    // The exponent as a double, by its bits instead of a conversion from 64-bit integers, which AVX2 does not have.
    const std::uint64_t e_bits = (above + (std::uint64_t{1024} << 52)) >> 52;
    const double e = std::bit_cast<double>(0x4330000000000000 | e_bits) - (0x1p52 + 1024);
    const double m = std::bit_cast<double>(bits - ((e_bits - 1024) << 52));
    const double t = (m - 1) / (m + 1), u = t * t;  // |t| <= 0.1716
    const double ln_m =
        2 * t *
        (1 +
         u * (1.0 / 3 +
              u * (1.0 / 5 + u * (1.0 / 7 + u * (1.0 / 9 + u * (1.0 / 11 + u * (1.0 / 13 + u * (1.0 / 15))))))));
    const double log2_power = std::max(n * (e + ln_m * std::numbers::log2e), -1000.0);
    // 2^y = 2^k 2^f, |f| <= 1/2.
    constexpr double kToInteger = 0x1.8p52;
    const double shifted = log2_power + kToInteger, z = (log2_power - (shifted - kToInteger)) * std::numbers::ln2;
    const double fraction =
        1 + z * (1 + z * (1.0 / 2 +
                          z * (1.0 / 6 +
                               z * (1.0 / 24 + z * (1.0 / 120 + z * (1.0 / 720 + z * (1.0 / 5040 + z / 40320)))))));
    const double scale = std::bit_cast<double>((std::bit_cast<std::uint64_t>(shifted) + 1023) << 52);
    return log2_power > -1000 ? fraction * scale : 0;
}

/// Binary logarithm of a positive normal number, to an error below 1e-6 or 2e-7 of the value.
[[nodiscard]] inline float log2_of(float x) noexcept {
    constexpr std::uint32_t kRootHalf = 0x3f3504f3;
    const auto bits = std::bit_cast<std::uint32_t>(x);
    const std::int32_t e = static_cast<std::int32_t>(bits - kRootHalf) >> 23;
    const float m = std::bit_cast<float>(bits - (static_cast<std::uint32_t>(e) << 23));
    const float t = (m - 1) / (m + 1), u = t * t;  // |t| <= 0.1716
    const float ln_m = 2 * t * (1 + u * (1.0f / 3 + u * (1.0f / 5 + u * (1.0f / 7 + u * (1.0f / 9)))));
    return static_cast<float>(e) + ln_m * std::numbers::log2e_v<float>;
}
/// 2^y for |y| <= 125, to a relative error below 1e-6 where |y| <= 16 (rounding of y beyond).
[[nodiscard]] inline float exp2_of(float y) noexcept {
    constexpr float kToInteger = 0x1.8p23f;
    const float shifted = y + kToInteger, z = (y - (shifted - kToInteger)) * std::numbers::ln2_v<float>;
    const float fraction =
        1 + z * (1 + z * (1.0f / 2 + z * (1.0f / 6 + z * (1.0f / 24 + z * (1.0f / 120 + z * (1.0f / 720))))));
    return fraction * std::bit_cast<float>((std::bit_cast<std::uint32_t>(shifted) + 127) << 23);
}

}  // namespace narpa
