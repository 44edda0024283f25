/// renderer/integrator/batch_sampler.h - PixelSampler::point for sixteen samples at once, bit-identical.
#pragma once

#include "base/lanes.h"
#include "renderer/integrator/sampler.h"

namespace narpa {

class BatchSampler {
public:
    using Points = std::array<Lanes<double>, 4>;

    /// `pixel`, `sample`: for each of the first n lanes, the number of its pixel and the sample's index in that
    /// pixel's sequence.
    BatchSampler(std::uint64_t seed, std::uint32_t frame, std::size_t n, const Lanes<std::uint32_t>& pixel,
                 const Lanes<std::uint32_t>& sample) noexcept
        : n_(n), sample_(sample) {
        using sampler_detail::mix;
        const std::uint64_t frame_part = mix(seed) ^ (std::uint64_t{frame} << 32);
        Lanes<std::uint64_t> a;
        for (std::size_t i = 0; i < kLanes; ++i) a[i] = mix(frame_part ^ pixel[i]);
        key_ = key_of(a);
    }
    /// The first four dimensions.
    void points(Points& u) const noexcept { scrambled(sample_, key_, u); }
    /// Four further dimensions; group > 0.
    void points(std::uint32_t group, Points& u) const noexcept {
        Lanes<std::uint64_t> a;
        Lanes<std::uint32_t> shuffled;
        shuffle(group, a, shuffled);
        scrambled(shuffled, key_of(a), u);
    }
    /// Only the first of these dimensions. Sobol's first one is the index itself, bits reversed.
    void first_dimension(std::uint32_t group, Lanes<double>& u) const noexcept {
        Lanes<std::uint64_t> a;
        Lanes<std::uint32_t> shuffled;
        shuffle(group, a, shuffled);
        for (std::size_t i = 0; i < kLanes; ++i)
            u[i] = 0x1p-32 * sampler_detail::scramble_reversed(shuffled[i], static_cast<std::uint32_t>(a[i]));
    }

private:
    using Keys = std::array<Lanes<std::uint32_t>, 4>;

    /// Key of the group and index in it.
    void shuffle(std::uint32_t group, Lanes<std::uint64_t>& a, Lanes<std::uint32_t>& shuffled) const noexcept {
        using namespace sampler_detail;
        for (std::size_t i = 0; i < kLanes; ++i)
            a[i] = mix(((std::uint64_t{key_[1][i]} << 32) | key_[0][i]) + group);
        for (std::size_t i = 0; i < kLanes; ++i)
            shuffled[i] = scramble_reversed(reverse_bits(sample_[i]), static_cast<std::uint32_t>(mix(mix(a[i]))));
    }

    static Keys key_of(const Lanes<std::uint64_t>& a) noexcept {
        Keys key;
        for (std::size_t i = 0; i < kLanes; ++i) {
            const std::uint64_t b = sampler_detail::mix(a[i]);
            key[0][i] = static_cast<std::uint32_t>(a[i]);
            key[1][i] = static_cast<std::uint32_t>(a[i] >> 32);
            key[2][i] = static_cast<std::uint32_t>(b);
            key[3][i] = static_cast<std::uint32_t>(b >> 32);
        }
        return key;
    }

    void scrambled(const Lanes<std::uint32_t>& index, const Keys& key, Points& u) const noexcept {
        using namespace sampler_detail;
        std::uint32_t any = 0;
        for (std::size_t i = 0; i < n_; ++i) any |= index[i];
        std::array<Lanes<std::uint32_t>, 4> x{};
        for (unsigned bit = 0; any >> bit != 0; ++bit) {
            const auto& column = kReversedSobol[bit];
            for (std::size_t i = 0; i < kLanes; ++i) {
                const std::uint32_t mask = -(index[i] >> bit & 1u);
                for (std::size_t dim = 0; dim < 4; ++dim) x[dim][i] ^= column[dim] & mask;
            }
            if (bit == 31) break;
        }
        for (std::size_t dim = 0; dim < 4; ++dim)
            for (std::size_t i = 0; i < kLanes; ++i)
                u[dim][i] = 0x1p-32 * scramble_reversed(x[dim][i], key[dim][i]);
    }

    std::size_t n_;
    Lanes<std::uint32_t> sample_;
    Keys key_;
};

}  // namespace narpa
