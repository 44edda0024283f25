/// renderer/frame/sample_plan.h - number of samples for each pixel, in successive stages.
///
/// Adaptive sampling, where edges cause most of the error: in frames lit only by the Sun, and in those of paths
/// with few samples per pixel. For a given total, the error is least if the number of samples is proportional to
/// the standard deviation of a pixel's samples (J. Neyman, J. R. Stat. Soc. 97, 1934), or to a somewhat lower power
/// of it where low-discrepancy points converge faster than random ones. The standard deviations come from the
/// contrasts of the G-buffer, never from the samples that count, because these would be biased by their own number
/// (D. Kirk, J. Arvo, "Unbiased sampling techniques for image synthesis", SIGGRAPH 1991). In light of two parts
/// they are those of the direct part, which has no noise. Numbers are powers of two, at which these points are at
/// their best; between two powers a hash of the pixel decides, so that totals follow the budget smoothly.
///
/// A pixel keeps its centre sample until it gets kFewest samples at once: where a centre has the squared error e of
/// an edge, 1, 2, 4 or 8 samples have 2 e, 0.7 e, 0.25 e or 0.09 e, and 4 gain most per sample.
///
/// Uniform sampling, for all other frames: every pixel gets the same number of samples, and those in the tiles of a
/// fixed pattern one more; whole tiles, because paths are reused within a tile. With paths, noise is everywhere,
/// and an adaptive plan measured no better at equal error (docs/performance.md). But separate direct sunlight,
/// and emission in view, get samples of their own by an adaptive plan beside the uniform one.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cassert>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "renderer/frame/g_buffer.h"

namespace narpa {

class SamplePlan {
public:
    /// Adaptive: limits of a pixel's samples, unless it has none.
    static constexpr std::uint32_t kFewest = 4, kMaxSamples = 1024;

    explicit SamplePlan(std::size_t tiles);

    /// Adaptive: sets the weights of the pixels of these tiles by the G-buffer, in parallel. No pixel has samples
    /// yet.
    void make_adaptive(const Frame& f, const GBuffer& g_buffer, std::span<const std::uint32_t> tiles);
    /// Adaptive: true if some pixel differs from its neighbours.
    [[nodiscard]] bool any_contrast() const noexcept { return any_contrast_; }
    /// Resets all pixels to no samples; later calls of `make_adaptive` set those of their tiles.
    void clear() noexcept;
    /// Uniform, over these tiles of the frame's image.
    void make_uniform(const Frame& f, std::span<const std::uint32_t> tiles);
    [[nodiscard]] bool is_uniform() const noexcept { return uniform_; }

    /// A stage determines the number of samples of each pixel, which never falls from stage to stage.
    struct Stage {
        int level = std::numeric_limits<int>::min() / 2;
        friend bool operator==(const Stage&, const Stage&) = default;
    };
    /// The stage without samples, and the stage of a uniform plan with this many samples for every pixel.
    [[nodiscard]] static constexpr Stage none() noexcept { return {}; }
    [[nodiscard]] static constexpr Stage samples_each(int samples) noexcept { return {samples * kRanks}; }
    /// True if every pixel of a uniform plan has at least this many samples.
    [[nodiscard]] static constexpr bool reaches(Stage stage, int samples) noexcept {
        return stage.level >= samples_each(samples).level;
    }

    [[nodiscard]] std::uint32_t count(std::size_t tile, std::size_t place, Stage stage) const noexcept {
        assert(tile < ranks_.size() && place < kTilePixels);
        return uniform_ ? of_rank(ranks_[tile], stage) : count(weights_[tile][place], stage);
    }
    /// Samples of all pixels.
    [[nodiscard]] std::uint64_t total(Stage stage) const noexcept;
    /// Number of these samples that have a path; uniform plans only.
    [[nodiscard]] std::uint64_t total_paths(Stage stage) const noexcept;
    /// The furthest stage that takes at most `rays` rays beyond those of `from`, at this many rays per sample and
    /// per path.
    [[nodiscard]] Stage reach(Stage from, double rays, double each_sample = 1, double each_path = 0) const noexcept;

    /// Uniform: the stage nearest to this one at which all pixels have equally many samples, and their number.
    [[nodiscard]] static Stage whole(Stage stage) noexcept {
        return samples_each((std::max(stage.level, 0) + kRanks / 2) / kRanks);
    }
    /// Uniform: the least number of samples of a pixel.
    [[nodiscard]] static std::uint32_t least_of(Stage stage) noexcept { return of_rank(kRanks - 1, stage); }
    /// Adaptive: samples beyond the first `each` of every pixel, of all pixels.
    [[nodiscard]] std::uint64_t total_beyond(std::uint32_t each, Stage stage) const noexcept;
    /// The furthest stage with at most this many such samples.
    [[nodiscard]] Stage reach_beyond(std::uint32_t each, double samples) const noexcept;

    [[nodiscard]] const TileContrast& contrast(std::size_t tile) const noexcept { return contrasts_[tile]; }

private:
    using Weight = std::int16_t;             ///< logarithm of the weight; -1: pixel outside the image
    static constexpr int kPerDoubling = 64;  ///< weights that differ by this are in the ratio 2 : 1
    static constexpr int kWeights = 24 * kPerDoubling;
    static constexpr int kMinNonUniformWeight = 3 * kPerDoubling;  ///< smaller weights: uniform surroundings
    static constexpr int kFirst = std::countr_zero(kFewest) * kPerDoubling;
    static constexpr int kFull = std::countr_zero(kMaxSamples) * kPerDoubling;  ///< kMaxSamples everywhere
    // Uniform: the level of a stage is a number of ranks of tiles, each of which adds a sample.
    static constexpr int kRanks = 64, kMaxEach = 1 << 20;
    struct Sums {
        double variance = 0, deviation = 0;
    };

    [[nodiscard]] std::uint32_t count(Weight weight, Stage stage) const noexcept {
        const int doublings = weight + stage.level;
        if (weight < 0 || doublings < kFirst) return 0;
        return doublings < kFull ? 1u << (doublings / kPerDoubling) : kMaxSamples;
    }
    [[nodiscard]] static std::uint32_t of_rank(int rank, Stage stage) noexcept {
        return stage.level <= rank ? 0 : static_cast<std::uint32_t>((stage.level - rank - 1) / kRanks + 1);
    }
    void contrast_tile(const Frame& f, const GBuffer& g_buffer, std::size_t tile) noexcept;
    using Histogram = std::array<std::uint32_t, kWeights>;  ///< pixels of each weight
    void set_weights(const Frame& f, const GBuffer& g_buffer, std::uint32_t tile, double typical_variance,
                     Histogram& histogram) noexcept;

    bool uniform_ = false, any_contrast_ = false;
    bool all_by_paths_ = false;  ///< uniform: every sample has a path; else as paths_of()
    std::vector<TileContrast> contrasts_;
    std::vector<PerPixel<Weight>> weights_;
    std::vector<Sums> sums_;                      ///< of each tile
    std::vector<PerPixel<std::uint8_t>> dither_;  ///< added to the weights: a hash of the pixel
    std::array<std::atomic<std::uint32_t>, kWeights> histogram_{};
    std::vector<std::uint8_t> ranks_;                     ///< uniform: rank of each tile in the pattern
    std::array<std::uint64_t, kRanks> pixels_of_rank_{};  ///< in the tiles of the plan
};

/// Number of a pixel's first samples that have a path where the light has two parts (BatchRadiance): the first two,
/// then the first half of each octave of its sequence from the fifth on, so that powers of two have half as many.
/// The other samples show only edges and direct sunlight.
[[nodiscard]] constexpr std::uint32_t paths_of(std::uint32_t samples) noexcept {
    if (samples <= 2) return samples;
    const std::uint32_t octave = std::bit_floor(samples - 1);  // octave < samples <= 2 octave
    return octave / 2 + std::min(samples - octave, octave / 2);
}
/// True if this sample of a pixel's sequence has a path.
[[nodiscard]] constexpr bool has_path(std::uint32_t sample) noexcept {
    return paths_of(sample + 1) > paths_of(sample);
}

}  // namespace narpa
