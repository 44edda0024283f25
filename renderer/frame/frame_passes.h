/// renderer/frame/frame_passes.h - the rendering passes of a frame.
///
/// A pass covers the tiles that may show something; the others show the background. A pass completes or is
/// discarded as a whole; `show_...` then writes its result to the image.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "base/radiance_image.h"
#include "renderer/frame/culling/tile_culling.h"
#include "renderer/frame/frame_error.h"
#include "renderer/frame/g_buffer.h"
#include "renderer/frame/pixel_fill.h"
#include "renderer/frame/sample_plan.h"

namespace narpa {

/// Limits at which a pass is aborted.
struct PassLimit {
    std::int64_t until_ns = std::numeric_limits<std::int64_t>::max();  ///< CLOCK_MONOTONIC
    std::uint64_t rays = std::numeric_limits<std::uint64_t>::max();
};

struct PassCount {
    bool complete = true;
    std::uint64_t samples = 0, rays = 0;
    std::uint64_t batches = 0;               ///< of at most 16 samples
    std::uint64_t paths = 0, path_rays = 0;  ///< samples with a path; rays beyond first surfaces
    std::uint64_t met = 0, separate = 0;     ///< samples that hit a surface; those with separate direct sunlight
    std::int64_t wall_ns = 0;

    PassCount& operator+=(const PassCount& b) noexcept {
        complete = complete && b.complete;
        samples += b.samples, rays += b.rays, batches += b.batches, paths += b.paths, path_rays += b.path_rays;
        met += b.met, separate += b.separate, wall_ns += b.wall_ns;
        return *this;
    }
};

class FramePasses {
public:
    /// Both arguments outlive it.
    FramePasses(const Tracer& tracer, const Camera& camera);

    /// Prepares a frame: finds the tiles that may show something. `lens`: its blur is allowed for; null: no blur.
    void begin(const Frame& f, const Lens* lens);
    /// Number of pixels in the tiles that may show something.
    [[nodiscard]] std::uint64_t pixels() const noexcept { return pixels_; }

    /// Renders each pixel with `spp` samples and writes the image. Writes the variance to `variance` unless null.
    /// `chosen`: renders only pixels where it is not 0; the others are undefined, and `spp` is at least 2. Empty:
    /// all pixels.
    PassCount uniform(const Frame& f, RadianceImage& out, std::vector<float>* variance,
                      std::span<const std::uint8_t> chosen = {});

    /// Tiles that a pass covers; those of the pilot pass are a sixteenth, evenly spread.
    enum class Tiles : std::uint8_t { all, pilot, all_but_pilot };
    /// Traces the centres of all pixels. `with_paths`: false for the direct part of the light alone.
    PassCount centres(const Frame& f, const PassLimit& limit, bool with_paths = true);
    /// Writes the centres to the image.
    void show_centres(const Frame& f, RadianceImage& out, std::vector<float>* variance);

    /// Allocates the memory of `begin_fill`, which may be needed in any frame within a budget.
    void keep_fill() {
        if (!fill_) fill_.emplace(g_buffer_);
    }
    /// Starts an image with less than one sample per pixel (pixel_fill.h).
    void begin_fill();
    void plan_fill(int stride, bool first) { fill_->plan(g_buffer_, tiles_, stride, first); }
    [[nodiscard]] const PixelFill& fill() const noexcept { return *fill_; }
    /// Traces the centres of the planned pixels between two stages.
    PassCount fill(const Frame& f, PixelFill::Stage from, PixelFill::Stage to, const PassLimit& limit);
    /// Reconstructs the pixels without a sample.
    void reconstruct() { fill_->reconstruct(g_buffer_, tiles_); }
    /// Writes the reconstructed image.
    void show_filled(const Frame& f, RadianceImage& out, std::vector<float>* variance);

    /// Makes an adaptive plan from the contrasts of the centres, or a uniform plan.
    void make_plan(const Frame& f, bool adaptive);
    [[nodiscard]] const SamplePlan& plan() const noexcept { return *plan_; }
    /// Traces the samples that stage `to` has beyond stage `from`.
    PassCount refine(const Frame& f, SamplePlan::Stage from, SamplePlan::Stage to, const PassLimit& limit,
                     Tiles which = Tiles::all);

    /// If direct sunlight or emission in view is separate: plans further samples of it from the contrasts of the
    /// centres, which must be those of this light alone. False: there are none.
    bool plan_sunlight(const Frame& f);
    [[nodiscard]] const SamplePlan& sunlight_plan() const noexcept { return *sunlight_plan_; }
    /// Traces samples of this light alone: for each pixel those beyond the ones of stage `from` of the uniform
    /// plan, up to stage `to` of that plan.
    PassCount refine_sunlight(const Frame& f, SamplePlan::Stage from, SamplePlan::Stage to, const PassLimit& limit);

    /// Writes the pixels' means at a stage of the plan to the image. `filled`: pixels without a sample are
    /// reconstructed.
    void show_means(const Frame& f, SamplePlan::Stage stage, bool filled, RadianceImage& out,
                    std::vector<float>* variance);

    /// Error of the image last written, or of the centres that the last plan was made from.
    [[nodiscard]] double standard_error() const noexcept;

    /// Returns the time per phase since the last call, if FrameSettings::times is set.
    [[nodiscard]] PhaseTimes times() noexcept;

private:
    class Worker;
    struct Tile;
    enum class Sums : std::uint8_t { counts, errors };
    template <class Work>
    PassCount over_tiles(const Frame& f, Sums sums, const PassLimit& limit, Work&& work);
    [[nodiscard]] Tile tile(std::uint32_t index) const noexcept;
    void find_background(const Frame& f);
    void fill_background(RadianceImage& out);
    void show_one_sample(Worker& w, const Tile& t, RadianceImage& out);
    void show_samples(Worker& w, const Tile& t, std::span<const std::uint8_t> chosen, RadianceImage& out,
                      std::vector<float>* variance);
    [[nodiscard]] bool estimates(std::uint32_t tile, std::size_t many) const noexcept;
    [[nodiscard]] bool fills_g_buffer(std::uint32_t tile) const noexcept;
    void estimate_centres(const Frame& f);
    [[nodiscard]] double weight_of_error_tiles(const std::vector<float>* variance) const;

    const Camera& camera_;
    TileCulling culling_;
    GBuffer g_buffer_;
    std::vector<std::uint32_t> tiles_;  ///< that may show something
    std::uint64_t pixels_ = 0;
    Rgb background_{};                ///< radiance of the other tiles
    std::vector<PassCount> counts_;   ///< of each chunk of tiles in the last pass
    std::vector<FrameError> errors_;  ///< of each chunk of tiles

    std::optional<SamplePlan> plan_, sunlight_plan_;  ///< allocated when first needed, as is means_
    std::vector<PerPixel<PixelMeans>> means_;
    std::optional<PixelFill> fill_;  ///< likewise
    bool direct_apart_ = false;      ///< `means_` has samples of the direct part alone

    // Tiles that still hold the background in the image that was last written, and that image's pixels and
    // background.
    std::vector<std::uint8_t> blank_;
    const Rgb* blank_image_ = nullptr;
    Rgb blank_background_{};
    std::array<std::atomic<std::int64_t>, kPhases> phase_ns_{};
};

}  // namespace narpa
