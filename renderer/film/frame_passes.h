/// renderer/film/frame_passes.h - the passes of which a frame is made.
///
/// A pass goes over the tiles in which something may be seen; the others show the background. It comes to its end
/// or is discarded whole; its result goes to the image by `show_...`, afterwards.
#pragma once

#include <atomic>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "renderer/film/frame_error.h"
#include "renderer/film/g_buffer.h"
#include "renderer/film/sample_plan.h"
#include "renderer/film/tile_culling.h"
#include "renderer/image/radiance_image.h"

namespace narpa {

/// Where a pass is given up.
struct PassLimit {
    std::int64_t until_ns = std::numeric_limits<std::int64_t>::max();  ///< CLOCK_MONOTONIC
    std::uint64_t rays = std::numeric_limits<std::uint64_t>::max();
};

struct PassCount {
    bool complete = true;
    std::uint64_t samples = 0, rays = 0;
    std::uint64_t paths = 0, path_rays = 0;  ///< samples of these that paths follow; rays beyond first surfaces
    std::uint64_t met = 0, separate = 0;  ///< samples that meet a surface; those whose direct sunlight is separate
    std::int64_t wall_ns = 0;
};

class FramePasses {
public:
    /// Both outlive it.
    FramePasses(const Tracer& tracer, const Camera& camera);

    /// Makes ready for a frame: finds the tiles in which something may be seen. `lens` may blur it; null: none
    /// does.
    void begin(const Frame& f, const Lens* lens);
    /// Pixels in which something may be seen.
    [[nodiscard]] std::uint64_t pixels() const noexcept { return pixels_; }

    /// Each pixel with `spp` samples, shown at once. Its variance goes to `variance`, if that is not null. Of
    /// `chosen` pixels alone, those that are not 0: `spp` is at least 2, and the others hold anything then. Empty:
    /// all.
    PassCount uniform(const Frame& f, RadianceImage& out, std::vector<float>* variance,
                      std::span<const std::uint8_t> chosen = {});

    /// Which tiles a pass goes over: a sixteenth lie spread evenly.
    enum class Tiles : std::uint8_t { all, a_sixteenth, the_others };
    /// Centres of the pixels that represent squares of `stride` (1, 2 or 4) pixels, but for those of an earlier
    /// pass of stride `made` (0: there was none).
    PassCount centres(const Frame& f, int stride, int made, const PassLimit& limit);
    void show_centres(const Frame& f, int stride, RadianceImage& out);

    /// Adaptive, from the contrasts of the centres; else uniform.
    void make_plan(const Frame& f, bool adaptive);
    [[nodiscard]] const SamplePlan& plan() const noexcept { return *plan_; }
    /// The samples that stage `to` has beyond stage `from`.
    PassCount refine(const Frame& f, SamplePlan::Stage from, SamplePlan::Stage to, const PassLimit& limit,
                     Tiles which = Tiles::all);

    /// Where direct sunlight is separate: plans further samples of it from the contrasts of the centres, which
    /// belong to a frame by direct light.
    void plan_sunlight(const Frame& f);
    [[nodiscard]] const SamplePlan& sunlight_plan() const noexcept { return *sunlight_plan_; }
    /// Of each pixel, samples of direct sunlight alone beyond the first `each`, up to what that plan has at the
    /// stage `to`.
    PassCount refine_sunlight(const Frame& f, std::uint32_t each, SamplePlan::Stage to, const PassLimit& limit);

    /// Shows the pixels' means at a stage of the plan.
    void show_means(const Frame& f, SamplePlan::Stage stage, RadianceImage& out, std::vector<float>* variance);

    /// Of the image that `uniform` or `show_means` has shown last, or of the centres that were planned from.
    [[nodiscard]] double standard_error() const noexcept;

    /// Returns where the time went since the last call, where the frames' settings ask for it.
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
    [[nodiscard]] bool estimates(std::uint32_t tile) const noexcept;
    [[nodiscard]] bool fills_g_buffer(std::uint32_t tile) const noexcept;
    void estimate_centres(const Frame& f);

    const Camera& camera_;
    TileCulling culling_;
    GBuffer g_buffer_;
    std::vector<std::uint32_t> tiles_;  ///< in which something may be seen
    std::uint64_t pixels_ = 0;
    Rgb background_{};                ///< of the others
    std::vector<FrameError> errors_;  ///< of each chunk of tiles

    std::optional<SamplePlan> plan_, sunlight_plan_;  ///< made when a frame first needs them, as are:
    std::vector<PerPixel<PixelMeans>> means_;

    // Tiles that still have the background in the image that was last written, and which that was.
    std::vector<std::uint8_t> blank_;
    const Rgb* blank_image_ = nullptr;
    Rgb blank_background_{};
    std::array<std::atomic<std::int64_t>, kPhases> phase_ns_{};
};

}  // namespace narpa
