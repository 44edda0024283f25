/// renderer/integrator/sampler.h - the sample points of a pixel: a low-discrepancy set that depends only on (seed,
/// frame, pixel, sample).
///
/// The first four dimensions of Sobol's sequence (direction numbers: S. Joe, F. Kuo, "Constructing Sobol sequences
/// with better two-dimensional projections", SIAM J. Sci. Comput. 30, 2008), each nested-uniformly scrambled by a
/// hash of the pixel (A. Owen 1995; B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020). Any power
/// of two of samples is stratified in each dimension, and in the pixel's two jointly. Paths take further dimensions
/// in groups of four, each group the same sequence with its own order and scrambling (Burley's padding), so that
/// every group is equally well stratified and groups are independent.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

namespace narpa {

/// Coordinates in [0, 1). In the first group, dimensions 0, 1 are the position in the pixel, 2, 3 the position on
/// the lens, or on the Sun's disc if there is no lens.
using SamplePoint = std::array<double, 4>;

namespace sampler_detail {

using Directions = std::array<std::uint32_t, 32>;

constexpr std::array<Directions, 4> sobol_directions() {
    struct Polynomial {
        unsigned degree, coefficients;
        std::array<std::uint32_t, 3> m;
    };
    constexpr std::array<Polynomial, 3> polynomial{{{1, 0, {1, 0, 0}}, {2, 1, {1, 3, 0}}, {3, 1, {1, 3, 1}}}};
    std::array<Directions, 4> v{};
    for (unsigned i = 0; i < 32; ++i) v[0][i] = 0x80000000u >> i;
    for (unsigned dim = 1; dim < 4; ++dim) {
        const auto& [s, a, m] = polynomial[dim - 1];
        for (unsigned i = 0; i < 32; ++i) {
            if (i < s) {
                v[dim][i] = m[i] << (31 - i);
                continue;
            }
            v[dim][i] = v[dim][i - s] ^ (v[dim][i - s] >> s);
            for (unsigned k = 1; k < s; ++k)
                if ((a >> (s - 1 - k)) & 1u) v[dim][i] ^= v[dim][i - k];
        }
    }
    return v;
}
constexpr std::uint32_t reverse_bits(std::uint32_t x) {
    x = ((x & 0x55555555u) << 1) | ((x >> 1) & 0x55555555u);
    x = ((x & 0x33333333u) << 2) | ((x >> 2) & 0x33333333u);
    x = ((x & 0x0f0f0f0fu) << 4) | ((x >> 4) & 0x0f0f0f0fu);
    return __builtin_bswap32(x);
}

/// Contribution of each bit of an index, lowest bit first, to the four dimensions, bit-reversed as scrambling needs
/// it.
inline constexpr auto kReversedSobol = [] {
    const std::array<Directions, 4> directions = sobol_directions();
    std::array<std::array<std::uint32_t, 4>, 32> by_bit{};
    for (unsigned bit = 0; bit < 32; ++bit)
        for (unsigned dim = 0; dim < 4; ++dim) by_bit[bit][dim] = reverse_bits(directions[dim][bit]);
    return by_bit;
}();

/// Sobol's point of this index, its fractions bit-reversed.
constexpr std::array<std::uint32_t, 4> reversed_sobol(std::uint32_t index) {
    std::array<std::uint32_t, 4> x{};
    for (; index != 0; index &= index - 1)
        for (unsigned dim = 0; dim < 4; ++dim)
            x[dim] ^= kReversedSobol[static_cast<unsigned>(std::countr_zero(index))][dim];
    return x;
}

/// Owen scrambling of a bit-reversed binary fraction: each bit is flipped by a hash of the more significant bits of
/// the fraction (Laine and Karras, with the constants of N. Vegdahl's improvement).
constexpr std::uint32_t scramble_reversed(std::uint32_t x, std::uint32_t seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverse_bits(x);
}

/// A 64-bit mixing function (SplitMix64's finaliser, Steele, Lea, Flood 2014).
constexpr std::uint64_t mix(std::uint64_t z) {
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

}  // namespace sampler_detail

class PixelSampler {
public:
    constexpr PixelSampler(std::uint64_t seed, std::uint32_t frame, std::uint32_t pixel) {
        using sampler_detail::mix;
        const std::uint64_t a = mix(mix(seed) ^ ((std::uint64_t{frame} << 32) | pixel)), b = mix(a);
        key_ = {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(a >> 32), static_cast<std::uint32_t>(b),
                static_cast<std::uint32_t>(b >> 32)};
    }
    [[nodiscard]] constexpr SamplePoint point(std::uint32_t sample) const {
        return scrambled(sampler_detail::reversed_sobol(sample), key_);
    }
    /// Four further dimensions; group 0 is the function above.
    [[nodiscard]] constexpr SamplePoint point(std::uint32_t sample, std::uint32_t group) const {
        using sampler_detail::mix;
        if (group == 0) return point(sample);
        const std::uint64_t a = mix(((std::uint64_t{key_[1]} << 32) | key_[0]) + group), b = mix(a), c = mix(b);
        // A nested shuffle of the order keeps every aligned power of two of samples together.
        const std::uint32_t shuffled =
            sampler_detail::scramble_reversed(sampler_detail::reverse_bits(sample), static_cast<std::uint32_t>(c));
        return scrambled(sampler_detail::reversed_sobol(shuffled),
                         {static_cast<std::uint32_t>(a), static_cast<std::uint32_t>(a >> 32),
                          static_cast<std::uint32_t>(b), static_cast<std::uint32_t>(b >> 32)});
    }

private:
    static constexpr SamplePoint scrambled(const std::array<std::uint32_t, 4>& reversed,
                                           const std::array<std::uint32_t, 4>& key) {
        SamplePoint p{};
        for (unsigned dim = 0; dim < 4; ++dim)
            p[dim] = 0x1p-32 * sampler_detail::scramble_reversed(reversed[dim], key[dim]);
        return p;
    }

    std::array<std::uint32_t, 4> key_{};
};

}  // namespace narpa
