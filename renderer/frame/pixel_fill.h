/// renderer/frame/pixel_fill.h - images with less than one sample per pixel: which pixels are traced, and the
/// reconstruction of the others.
///
/// Pixels are traced from lattice to lattice: one in 4 x 4 (left out if one in 2 x 2 fits), then one in 2 x 2, then
/// all; what is left out of a lattice is reconstructed before the next finer one is planned. Within a lattice they
/// are traced in groups of one tile, as many as a batch of rays holds, because a batch takes the same time whether
/// it is full or not: those groups first whose pixels' neighbours in the coarser lattice differ most. A pixel that
/// was not traced takes the mean of its traced neighbours, those beside it with twice the weight of the diagonal
/// ones, and only those on one side of a silhouette: on the side with the larger weight, by a hash of the pixel
/// where both are equal, so that silhouettes do not move on average.
///
/// The error of reconstruction is measured: each traced pixel is compared with what its neighbours in the coarser
/// lattice say of it; a few groups come first whatever their contrast. An edge has no scale, so pixels of equal
/// contrast have similar errors in both lattices: the mean square of the differences, octave by octave of contrast,
/// predicts the error of the pixels that were not traced.
#pragma once

#include <array>
#include <cstddef>
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

    /// A stage determines which planned pixels are traced; more from stage to stage.
    struct Stage {
        int level = 0;
    };
    /// Plans the pixels of the lattice of `stride` (4, 2 or 1) that are not traced yet: in a frame's first lattice
    /// tile by tile in no order, else by contrast. The planned pixels are reconstructed from the next coarser
    /// lattice, whose own pixels keep what they were reconstructed as if they were not traced.
    void plan(GBuffer& g_buffer, std::span<const std::uint32_t> tiles, int stride, bool first);
    /// The stage of all planned pixels.
    [[nodiscard]] static Stage all() noexcept { return {kLevels}; }
    /// Number of planned pixels up to this stage.
    [[nodiscard]] std::uint64_t total(Stage stage = all()) const noexcept;
    /// The furthest stage with at most this many pixels beyond those of `from`.
    [[nodiscard]] Stage reach(Stage from, double pixels) const noexcept;
    /// The planned pixels of a tile that are traced between the two stages: a bit for each place.
    [[nodiscard]] std::uint64_t between(std::uint32_t tile, Stage from, Stage to) const noexcept;
    /// A pass was given up: it may have overwritten reconstructed pixels.
    void set_overwritten() noexcept { overwritten_ = true; }
    /// Counts these pixels of all tiles as traced, and compares them with their neighbours.
    void take(const GBuffer& g_buffer, std::span<const std::uint32_t> tiles, Stage from, Stage to);

    /// Number of lattices that are still to be reconstructed, at most; of the last plan's only where pixels were
    /// traced since.
    [[nodiscard]] int lattices_left() const noexcept { return has_contrasts_ ? stride_ : stride_ / 2; }
    [[nodiscard]] bool reconstructs_all() const noexcept { return !has_contrasts_; }
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
    static constexpr int kOctaves = 24, kPerOctave = 64;
    static constexpr int kFirstLevels = 64;  ///< of pixels that come first whatever their contrast, in no order
    static constexpr int kLevels = kFirstLevels + kOctaves * kPerOctave;
    /// Sums are formed in so many parts of the tiles, so that they do not depend on the threads.
    static constexpr std::size_t kParts = 32;
    struct Comparison {
        double squares = 0, contrasts = 0, pixels = 0;  ///< sums; contrasts: of their squares

        Comparison& operator+=(const Comparison& b) noexcept {
            squares += b.squares, contrasts += b.contrasts, pixels += b.pixels;
            return *this;
        }
    };
    using Comparisons = std::array<Comparison, kOctaves>;
    struct Compared {
        Comparisons first{}, others{};  ///< first: traced whatever their contrast
    };
    using Levels = std::array<std::uint32_t, kLevels + 1>;  ///< number of planned pixels of each level
    /// The planned pixels of a tile in groups: a bit for each pixel, and the level from which on they are traced.
    struct Groups {
        std::array<std::uint64_t, 4> places{};
        std::array<std::int16_t, 4> level{};
        std::size_t n = 0;

        void add(std::uint64_t of, int from) noexcept;
    };
    /// What the neighbours in the coarser lattice say of a tile's pixels: mean bands.
    struct Guess {
        PerPixel<float> radiance, contrast;  ///< contrast: the neighbours' largest difference
        std::uint64_t known = 0;             ///< a bit for each pixel
        std::uint64_t silhouettes = 0;       ///< one passes between the neighbours
    };
    /// The expected squared error of a contrast of an octave: the sum of a part of its square and a constant.
    struct OctaveError {
        double of_square = 0, constant = 0;
    };
    template <class Do>
    static void over_parts(std::size_t tiles, Do&& act);

    using Known = std::vector<std::uint64_t>;  ///< pixels with a value, a bit for each pixel of a tile
    void reconstruct_tile(GBuffer& g_buffer, std::uint32_t tile, int stride, const Known& known,
                          std::uint64_t places, std::uint64_t to_guess) noexcept;
    void group(std::uint32_t tile) noexcept;
    void show_changes(GBuffer& g_buffer, std::span<const std::uint32_t> tiles) noexcept;
    void find_errors() noexcept;
    [[nodiscard]] std::uint64_t within(std::uint32_t tile) const noexcept;
    [[nodiscard]] float contrast_of(const Guess& guess, std::size_t place) const noexcept;
    /// Position of a contrast in the order of all, in equal steps per octave; 0: the frame's largest.
    [[nodiscard]] int order_of(float contrast, int per_octave) const noexcept;
    [[nodiscard]] int octave_of(float contrast) const noexcept { return order_of(contrast, 1); }

    int width_, height_, tiles_x_;
    std::vector<std::uint64_t> traced_, planned_;  ///< a bit for each pixel of a tile
    Known known_, known_at_plan_;
    std::vector<std::uint64_t> compared_first_;
    std::vector<std::uint8_t> changed_;  ///< tiles that no longer show the background alone
    std::vector<Groups> groups_;
    std::vector<Guess> guess_;  ///< of pixels that are planned or reconstructed
    Levels pixels_{};
    std::vector<Levels> levels_of_part_;
    std::vector<Compared> compared_by_part_;
    Compared compared_, compared_coarser_;  ///< of this plan's lattice and the one before
    std::array<OctaveError, kOctaves> errors_{};
    int stride_ = 2;              ///< of the last plan
    bool has_contrasts_ = false;  ///< a lattice was planned by contrast
    bool overwritten_ = false;
    float most_ = 1;  ///< the frame's largest contrast
};

}  // namespace narpa
