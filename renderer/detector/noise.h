/// renderer/detector/noise.h - standard normals and Poisson counts for batches of kLanes pixels.
///
/// Lanes are independent and branch-free so that the loops vectorise; logarithm, sine and cosine are written out
/// for that reason. The polynomials are minimax fits; the bound beside each is that of its weighted error.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "base/counter_random.h"

namespace narpa {

/// -ln u of the uniform number u = (word + 1/2) / 2^32, to a relative error of 2.5e-7.
inline float minus_log(std::uint32_t word) noexcept {
    constexpr std::uint32_t kSqrtHalf = 0x3f3504f3u;  // bits of the float
    constexpr float kLn2 = 0.693147181f;
    // word + 1/2 = 2^e m, m from sqrt(1/2) to sqrt(2), and ln u = (e - 32) ln 2 + ln(1 + f).
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(static_cast<float>(word) + 0.5f);
    const std::int32_t e = static_cast<std::int32_t>(bits - kSqrtHalf) >> 23;
    const float m = std::bit_cast<float>(bits - (static_cast<std::uint32_t>(e) << 23));
    // Near u = 1 the rounding of u would dominate 1 - u, so 1 - u is formed from the integer.
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
inline SineCosine sincos_of_word(std::uint32_t word) noexcept {
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

/// Two independent standard normals per lane, by Box and Muller (1958) in single precision: to 1e-6, up to 6.7
/// standard deviations.
struct alignas(64) NormalLanes {
    Lanes<float> a, b;
};
inline NormalLanes normals(const RandomLanes& random) noexcept {
    NormalLanes out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const float radius = std::sqrt(2 * minus_log(random.w0[i]));
        const SineCosine angle = sincos_of_word(random.w1[i]);
        out.a[i] = radius * angle.cosine;
        out.b[i] = radius * angle.sine;
    }
    return out;
}

/// A uniform number in (0, 1) per lane, of 52 bits and a half.
inline Lanes<double> uniforms(const RandomLanes& random) noexcept {
    Lanes<double> out;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const std::uint64_t bits = (std::uint64_t{random.w2[i]} << 32 | random.w3[i]) >> 12;
        out[i] = std::bit_cast<double>(0x3ff0000000000000u | bits) - (1 - 0x1p-53);
    }
    return out;
}

/// Counts with this mean or more are drawn by the normal approximation.
inline constexpr double kPoissonExactBelow = 32;

/// Poisson counts of means in [0, kPoissonExactBelow) by inversion of the distribution function, which is accurate
/// to 1e-13.
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
    // kMax, 13 standard deviations above the largest mean, ends sums that rounding keeps below `uniform`. Finished
    // lanes do not change; whether all are finished is tested every kStride steps.
    constexpr int kMax = 112, kStride = 4;
    for (int k = 0; k < kMax; k += kStride) {
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
/// is subtracted); the distribution functions differ by less than 1e-3. The deviation from the mean is in single
/// precision; -7 standard deviations still give a count above zero.
inline double normal_poisson(double mean, float normal) noexcept {
    const float spread = std::sqrt(static_cast<float>(mean - 5.0 / 36));
    const float departure = spread * normal + (normal * normal - 1) * (1.0f / 6);
    return std::floor(mean + static_cast<double>(departure) + 0.5);
}

/// Poisson counts of means >= 0. Each method runs only if a lane needs it.
inline Lanes<double> poisson(const Lanes<double>& mean, const NormalLanes& normal,
                             const RandomLanes& random) noexcept {
    std::uint64_t lit = 0, bright = 0;  // number of lanes
    for (std::size_t i = 0; i < kLanes; ++i) {
        lit += mean[i] > 0 ? 1u : 0u;
        bright += mean[i] >= kPoissonExactBelow ? 1u : 0u;
    }
    Lanes<double> count{};
    if (bright != 0)
        for (std::size_t i = 0; i < kLanes; ++i) {
            const double many = normal_poisson(mean[i], normal.a[i]);
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
