/// renderer/film/sample_plan.h - how many samples each pixel gets, from what the middles show around it.
///
/// For a given sum of samples the error is least where they are proportional to the standard deviation of a pixel's
/// samples (J. Neyman, J. R. Stat. Soc. 97, 1934), and to a somewhat lower power of it where low-discrepancy points
/// converge faster than random ones. Numbers are powers of two, at which these points are at their best; between
/// two powers a hash of the pixel decides, so that sums follow the budget smoothly.
///
/// A pixel keeps its middle, which costs nothing more, until it gets kFewest samples at once: where a middle leaves
/// the squared error e of an edge, 1, 2, 4 or 8 samples leave 2 e, 0.7 e, 0.25 e or 0.09 e, and of these 4 gain
/// most apiece. Of the noise of paths, whose variance v falls as 1 / n, a middle and 2 samples leave v and v / 2,
/// and 2 it is.
///
/// Nothing here looks at the samples that are counted: only at the middles, which are thrown away where there are
/// samples. And where a middle is a random sample itself, it has no say in whether it is shown: its neighbours
/// alone tell how noisy the pixel is and, where paths are followed, how much an edge through it matters; else those
/// that happen to be bright would be thrown away more often than others, and the image would lose light.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "renderer/film/g_buffer.h"

namespace narpa {

class SamplePlan {
public:
    /// Of a pixel, but for none.
    static constexpr std::uint32_t kFewest = 4, kFewestOfPaths = 2, kMostSamples = 1024;

    explicit SamplePlan(std::size_t tiles);

    /// Weighs the pixels of these tiles, in parallel. No pixel has samples yet.
    void weigh(const Frame& f, const GBuffer& looks, std::span<const std::uint32_t> tiles);

    /// A stage of the plan says how many samples each pixel has. Stages only grow.
    struct Stage {
        int level = std::numeric_limits<int>::min() / 2;
        friend bool operator==(const Stage&, const Stage&) = default;
    };
    [[nodiscard]] std::uint32_t count(std::size_t tile, std::size_t place, Stage stage) const noexcept {
        return count(weights_[tile][place], stage);
    }
    /// So many of these are followed by paths, where the light has two parts (PacketLight): as many for all pixels
    /// of a tile that see something, as its paths share what they find; elsewhere all.
    [[nodiscard]] std::uint32_t paths(std::size_t tile, std::size_t place, Stage stage) const noexcept {
        const Weight weight = weights_[tile][place];
        return paths(count(weight, stage), count(std::min(weight, path_weights_[tile]), stage));
    }
    /// Of all pixels.
    [[nodiscard]] std::uint64_t total(Stage stage) const noexcept;
    [[nodiscard]] std::uint64_t total_paths(Stage stage) const noexcept;
    /// The furthest stage that takes no more than this many samples beyond those of `from`.
    [[nodiscard]] Stage reach(Stage from, std::uint64_t samples) const noexcept;
    /// The same of rays, so many for each sample and for each path.
    [[nodiscard]] Stage reach(Stage from, double rays, double each_sample, double each_path) const noexcept;

    /// Pixels whose middle met something.
    [[nodiscard]] std::uint64_t met() const noexcept { return met_; }
    [[nodiscard]] const TileContrast& contrast(std::size_t tile) const noexcept { return contrasts_[tile]; }

private:
    using Weight = std::int16_t;             ///< logarithm; -1: a pixel beyond the image
    static constexpr int kPerDoubling = 64;  ///< weights that differ by so much are as 2 : 1
    static constexpr int kWeights = 24 * kPerDoubling;
    static constexpr int kEventful = 3 * kPerDoubling;  ///< below: all is the same around the pixel
    static constexpr int kFull = std::countr_zero(kMostSamples) * kPerDoubling;  ///< kMostSamples everywhere
    struct Sums {
        double variance = 0, deviation = 0;
        double paths = 0;   ///< variance of the light of paths, of all that met something
        double shared = 0;  ///< of it that of light that is shared
        std::uint64_t met = 0;
    };

    [[nodiscard]] std::uint32_t count(Weight weight, Stage stage) const noexcept {
        const int doublings = weight + stage.level;
        if (weight < 0 || doublings < first_) return 0;
        return doublings < kFull ? 1u << (doublings / kPerDoubling) : kMostSamples;
    }
    /// A pixel that has samples has one at least that a path follows.
    [[nodiscard]] static std::uint32_t paths(std::uint32_t samples, std::uint32_t wanted) noexcept {
        return std::max(wanted, std::min(samples, 1u));
    }
    /// A pixel's weight, a whole number of doublings above that of its tile's paths: whenever it gets more paths,
    /// it gets more samples. `even`: the latter, but for its hash. What sees something has as many samples as
    /// paths.
    [[nodiscard]] static int in_step(int weight, int even, int of_paths, bool sees) noexcept;
    template <class Fits>
    [[nodiscard]] static Stage furthest(Stage from, Fits&& fits) noexcept;
    void contrast_tile(const Frame& f, const GBuffer& looks, std::size_t tile) noexcept;
    /// Variance of light by the tiles around alone: what a tile's own paths found by chance must not decide which
    /// of its middles stay.
    [[nodiscard]] float around(const GBuffer& looks, std::size_t tile, double Sums::*variance) const noexcept;
    using Histogram = std::array<std::uint32_t, kWeights>;  ///< pixels of each weight
    void weigh_tile(const Frame& f, const GBuffer& looks, std::size_t tile, double typical_variance,
                    Histogram& histogram, Histogram& of_paths) noexcept;

    std::vector<TileContrast> contrasts_;
    std::vector<PerPixel<Weight>> weights_;
    std::vector<Weight> path_weights_;  ///< of each tile
    std::vector<Sums> sums_;            ///< of each tile
    std::uint64_t met_ = 0;
    int first_ = 0;  ///< doublings of the fewest samples
    std::array<std::atomic<std::uint32_t>, kWeights> histogram_{}, path_histogram_{};
};

}  // namespace narpa
