/// renderer/frame/pixel_fill.h - images with less than one sample per pixel: which pixels are traced, and the
/// reconstruction of the others.
///
/// Pixels are traced from lattice to lattice: one in 4 x 4, then one in 2 x 2, then all. Within a lattice those
/// come first whose neighbours in the coarser lattice differ most. A pixel that was not traced takes the mean of
/// its traced neighbours, those beside it with twice the weight of the diagonal ones, and only those on one side of
/// a silhouette: on the side with the larger weight, by a hash of the pixel where both are equal, so that
/// silhouettes do not move on average.
///
/// The error of reconstruction is measured: each traced pixel is compared with what its neighbours in the coarser
/// lattice say of it; a few come first whatever their contrast. An edge has no scale, so pixels of equal contrast
/// have similar errors in both lattices: the mean square of the differences, octave by octave of contrast, predicts
/// the error of the pixels that were not traced.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "renderer/frame/g_buffer.h"

namespace narpa {

class PixelFill {
public:
    explicit PixelFill(const GBuffer& g_buffer);

    /// Starts a frame: no pixel of these tiles is traced.
    void begin(std::span<const std::uint32_t> tiles) noexcept;
    /// Counts all pixels of a tile as traced.
    void set_traced(std::uint32_t tile) noexcept { traced_[tile] = ~std::uint64_t{0}; }

    /// A stage determines which planned pixels are traced; more from stage to stage.
    struct Stage {
        int level = 0;
    };
    /// Plans the pixels of the lattice of `stride` (4, 2 or 1) that are not traced yet. The next coarser lattice is
    /// traced as a whole, unless `stride` is 4.
    void plan(const GBuffer& g_buffer, std::span<const std::uint32_t> tiles, int stride);
    /// The stage of all planned pixels.
    [[nodiscard]] static Stage all() noexcept { return {kLevels}; }
    /// Number of planned pixels up to this stage.
    [[nodiscard]] std::uint64_t total(Stage stage = all()) const noexcept;
    /// The furthest stage with at most this many pixels beyond those of `from`.
    [[nodiscard]] Stage reach(Stage from, double pixels) const noexcept;
    /// The planned pixels of a tile that are traced between the two stages: a bit for each place.
    [[nodiscard]] std::uint64_t between(std::uint32_t tile, Stage from, Stage to) const noexcept;
    /// Counts these pixels of all tiles as traced, and compares them with their neighbours.
    void take(const GBuffer& g_buffer, std::span<const std::uint32_t> tiles, Stage from, Stage to);

    /// Gives the pixels that were not traced the values of their neighbours.
    void reconstruct(GBuffer& g_buffer, std::span<const std::uint32_t> tiles);
    [[nodiscard]] bool is_traced(std::uint32_t tile, std::size_t place) const noexcept {
        return (traced_[tile] >> place & 1) != 0;
    }
    /// Expected squared difference between a pixel's mean band and its neighbours'; of pixels without a plan, of
    /// any pixel.
    [[nodiscard]] double error_of(std::uint32_t tile, std::size_t place) const noexcept;
    /// Mean squared difference between traced pixels and their neighbours' mean, of the last plan.
    [[nodiscard]] double mean_square() const noexcept;

private:
    static constexpr int kOctaves = 24, kPerOctave = 64, kLevels = kOctaves * kPerOctave;
    struct Comparison {
        double squares = 0, contrasts = 0, pixels = 0;  ///< sums; contrasts: of their squares
    };
    using Comparisons = std::array<Comparison, kOctaves>;
    /// What the neighbours in the coarser lattice say of a pixel: mean bands.
    struct Guess {
        float radiance = 0;
        float contrast = -1;      ///< the neighbours' largest difference; negative: not planned
        bool silhouette = false;  ///< passes between them
    };
    struct Window;

    void guess_tile(const GBuffer& g_buffer, std::uint32_t tile, int stride) noexcept;
    void reconstruct_tile(GBuffer& g_buffer, std::uint32_t tile, int stride) noexcept;
    [[nodiscard]] float contrast_of(const Guess& guess) const noexcept;
    [[nodiscard]] int octave_of(float contrast) const noexcept;
    [[nodiscard]] int level_of(std::uint32_t tile, std::size_t place) const noexcept;

    int width_, height_, tiles_x_;
    std::vector<std::uint64_t> traced_, known_;        ///< a bit for each pixel of a tile; known: or reconstructed
    std::vector<std::uint8_t> changed_;                ///< tiles that no longer show the background alone
    std::vector<PerPixel<std::int16_t>> level_;        ///< from which on a pixel is traced; 0: not planned
    std::vector<PerPixel<Guess>> guess_;               ///< of planned pixels
    std::array<std::uint32_t, kLevels + 1> pixels_{};  ///< planned ones of each level
    Comparisons compared_{}, compared_coarser_{};      ///< of this plan's lattice and the one before
    int stride_ = 4;
    float most_ = 1;  ///< the frame's largest contrast
};

}  // namespace narpa
