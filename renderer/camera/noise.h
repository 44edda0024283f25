/// renderer/camera/noise.h - what pixels draw: standard normals and Poisson counts, sixteen side by side.
///
/// Every lane is a function of its own numbers alone, without a branch, so that the loops become vector code; the
/// few library functions that this needs are written out. The polynomials are minimax fits, of errors weighted as
/// the bound beside each says.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "renderer/camera/counter_random.h"

namespace narpa {

/// -ln u of the even number u = (word + 1/2) / 2^32, to 2.5e-7 of itself.
inline float minus_log(std::uint32_t word) noexcept {
    constexpr std::uint32_t kSqrtHalf = 0x3f3504f3u;  // bits of the float
    constexpr float kLn2 = 0.693147181f;
    // word + 1/2 = 2^e m, m from sqrt(1/2) to sqrt(2), and ln u = (e - 32) ln 2 + ln(1 + f).
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(static_cast<float>(word) + 0.5f);
    const std::int32_t e = static_cast<std::int32_t>(bits - kSqrtHalf) >> 23;
    const float m = std::bit_cast<float>(bits - (static_cast<std::uint32_t>(e) << 23));
    // Next to 1 the float has lost the digits that 1 - u is made of.
    const float one_less = -(static_cast<float>(static_cast<std::int32_t>(~word)) + 0.5f) * 0x1p-32f;
    const float f = e == 32 ? one_less : m - 1;
    // ln(1 + f) = f - f^2 / 2 + f^3 p(f), p to 4e-8 |f|^-2.
    const float p = 0.333338581f +
                    f * (-0.250017469f +
                         f * (0.199653980f +
                              f * (-0.165656346f + f * (0.148769626f + f * (-0.143502005f + f * 0.0891786330f)))));
    const float ln = f - f * f * (0.5f - f * p);
    return -(static_cast<float>(e - 32) * kLn2 + ln);
}

struct SineCosine {
    float sine, cosine;
};
/// Of the angle 2 pi (word + 1/2) / 2^32, to 1.5e-7.
inline SineCosine of_turn(std::uint32_t word) noexcept {
    const std::uint32_t quadrant = (word + 0x20000000u) >> 30;  // 3 and then 0 again where this wraps
    const auto rest = static_cast<std::int32_t>(word - (quadrant << 30));
    const float x = (static_cast<float>(rest) + 0.5f) * 1.46291808e-9f, z = x * x;  // radians, |x| <= pi / 4
    const float s = x + x * z * (-0.166666549f + z * (0.00833217792f + z * -0.000195172667f));  // 4e-9 |x|
    const float c =
        1 + z * (-0.499999997f + z * (0.0416666233f + z * (-0.00138867634f + z * 2.43904098e-5f)));  // 1e-10
    const bool swapped = (quadrant & 1) != 0;
    const auto sign = [](float v, std::uint32_t bit1) {
        return std::bit_cast<float>(std::bit_cast<std::uint32_t>(v) ^ (bit1 & 2u) << 30);
    };
    return {sign(swapped ? c : s, quadrant), sign(swapped ? s : c, quadrant + 1)};
}

/// Two independent standard normals for each lane, by Box and Muller (1958) in single precision: within 1e-6 of
/// the exact ones, up to 6.7 standard deviations.
struct alignas(64) NormalsPerLane {
    Lanes<float> a, b;
};
inline NormalsPerLane normals(const BlockPerLane& random) noexcept {
    NormalsPerLane out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const float radius = std::sqrt(2 * minus_log(random.w0[i]));
        const SineCosine angle = of_turn(random.w1[i]);
        out.a[i] = radius * angle.cosine;
        out.b[i] = radius * angle.sine;
    }
    return out;
}

/// An even number in (0, 1) for each lane: 52 bits and a half.
inline Lanes<double> uniforms(const BlockPerLane& random) noexcept {
    Lanes<double> out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const std::uint64_t bits = (std::uint64_t{random.w2[i]} << 32 | random.w3[i]) >> 12;
        out[i] = std::bit_cast<double>(0x3ff0000000000000u | bits) - (1 - 0x1p-53);
    }
    return out;
}

/// Means from here on take the normal approximation.
inline constexpr double kPoissonExactBelow = 32;

/// Poisson counts of means from 0 to less than kPoissonExactBelow, by inversion of the distribution, whose sums are
/// good to 1e-13.
inline Lanes<double> exact_poisson(const Lanes<double>& mean, const Lanes<double>& uniform) noexcept {
    // exp(-mean) = exp(-mean / 64)^64, by its power series.
    Lanes<double> p, sum, count{};
    p.fill(1);
    for (int n = 13; n > 0; --n) {
        const double part = -1.0 / (64 * n);
        for (std::size_t i = 0; i < kLanes; ++i) p[i] = 1 + p[i] * (mean[i] * part);
    }
    for (int n = 0; n < 6; ++n)
        for (std::size_t i = 0; i < kLanes; ++i) p[i] *= p[i];
    sum = p;
    // The bound is 13 standard deviations above the largest mean: sums that rounding keeps below `uniform` end. A
    // lane that has its count takes no harm from going on with the others; the end is looked for every few steps.
    constexpr int kMost = 112, kStride = 4;
    for (int k = 0; k < kMost; k += kStride) {
        for (int step = 1; step <= kStride; ++step) {
            const double part = 1.0 / (k + step);
            for (std::size_t i = 0; i < kLanes; ++i) {
                count[i] += sum[i] < uniform[i] ? 1.0 : 0.0;
                p[i] *= mean[i] * part;
                sum[i] += p[i];
            }
        }
        std::uint64_t more = 0;
        for (std::size_t i = 0; i < kLanes; ++i) more |= sum[i] < uniform[i] ? 1u : 0u;
        if (more == 0) break;
    }
    return count;
}

/// A Poisson count of a mean from kPoissonExactBelow to 1e38: the normal with the first Cornish-Fisher term,
/// rounded. Mean, variance and skewness stay exact (the variance that the term and the rounding add, 1/18 + 1/12,
/// is taken off), the distribution functions differ by less than 1e-3. The departure from the mean is in single
/// precision; not even -7 standard deviations take the count below zero.
inline double many_poisson(double mean, float normal) noexcept {
    const float spread = std::sqrt(static_cast<float>(mean - 5.0 / 36));
    const float departure = spread * normal + (normal * normal - 1) * (1.0f / 6);
    return std::floor(mean + static_cast<double>(departure) + 0.5);
}

/// Poisson counts of means that are not below zero. A packet pays for the methods that its lanes need.
inline Lanes<double> poisson(const Lanes<double>& mean, const NormalsPerLane& normal,
                             const BlockPerLane& random) noexcept {
    std::uint64_t lit = 0, bright = 0;  // how many
    for (std::size_t i = 0; i < kLanes; ++i) {
        lit += mean[i] > 0 ? 1u : 0u;
        bright += mean[i] >= kPoissonExactBelow ? 1u : 0u;
    }
    Lanes<double> count{};
    if (bright != 0)
        for (std::size_t i = 0; i < kLanes; ++i) {
            const double many = many_poisson(mean[i], normal.a[i]);
            count[i] = mean[i] >= kPoissonExactBelow ? many : 0.0;
        }
    if (lit != bright) {
        Lanes<double> small;
        for (std::size_t i = 0; i < kLanes; ++i) small[i] = mean[i] < kPoissonExactBelow ? mean[i] : 0.0;
        const Lanes<double> exact = exact_poisson(small, uniforms(random));
        for (std::size_t i = 0; i < kLanes; ++i) count[i] += exact[i];
    }
    return count;
}

}  // namespace narpa
