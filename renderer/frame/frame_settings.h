/// renderer/frame/frame_settings.h - settings, budget and account of a frame.
///
/// A frame is rendered in passes. The first takes one sample for each pixel; if even that may not fit the budget,
/// the frame goes from coarse to fine, so that a complete image exists early. With the Sun as the only light, the
/// first samples are the pixels' centres. Their contrasts decide where further samples go, and the centres are
/// discarded there: sample counts that depend on the samples themselves bias the mean (D. Kirk, J. Arvo, "Unbiased
/// sampling techniques for image synthesis", SIGGRAPH 1991). All other light gets uniform passes, whose samples all
/// count; but where only few samples per pixel fit, edges cause most of the error, and centres come first here too.
/// So they do if the Sun is the only source of direct light and the budget is large: after the uniform passes their
/// contrasts decide where further samples of direct sunlight go; where lamps can be in view, those of emission that
/// camera rays meet. The number of samples of a pass is fixed before it
/// begins, and a pass that does not end in time is discarded as a whole. So a frame is a function of the scene, the
/// poses, its number, the seed and the sizes of its passes: the clock only chooses these sizes.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "renderer/integrator/phase_clock.h"
#include "renderer/scene/scene.h"

namespace narpa {

inline constexpr std::size_t kMaxPasses = 8;  ///< after the first
/// Path-traced frames with separate direct sunlight or emission in view: the pass of samples of that light alone.
inline constexpr std::size_t kSunlightPass = kMaxPasses - 1;

/// How far a frame got. Stated in its ledger.
enum class FrameStep : std::uint8_t {
    refined,      ///< more samples, or spp of them
    one_sample,   ///< one sample of each pixel: its centre, or the first of its sequence
    no_indirect,  ///< centres of pixels, all or some, with direct light only although the scene asks for paths
    coarse_2,     ///< one pixel in 2 x 2 and more; the others are reconstructed
    coarse_4,     ///< one pixel in 4 x 4 and more; the others are reconstructed
    nothing,      ///< no pass: the image is unchanged
    sparse,       ///< between coarse_2 and one_sample, and further samples where they matter most
};

/// True if frames of step `a` are worse than those of `b`.
[[nodiscard]] constexpr bool is_worse(FrameStep a, FrameStep b) noexcept {
    constexpr std::array<int, 7> kRank{0, 2, 5, 3, 4, 6, 1};  // by FrameStep
    return kRank[static_cast<std::size_t>(a)] > kRank[static_cast<std::size_t>(b)];
}
/// True if pixels without a sample are reconstructed.
[[nodiscard]] constexpr bool is_filled(FrameStep s) noexcept {
    return s == FrameStep::sparse || s == FrameStep::coarse_2 || s == FrameStep::coarse_4;
}

struct FrameBudget {
    enum class Kind : std::uint8_t {
        samples,  ///< FrameSettings::spp for each pixel, in one pass
        rays,     ///< at most this many rays, those of subpixel bodies not counted; same bytes under any load
        time,     ///< the radiance is complete at the deadline
        aim,      ///< as `samples` if these are expected by the deadline, else as `time`
        passes,   ///< the passes of an account: repeats that frame
    };
    Kind kind = Kind::samples;
    std::uint64_t rays = 0;
    std::int64_t deadline_ns = 0;                    ///< CLOCK_MONOTONIC
    std::array<std::uint32_t, kMaxPasses> passes{};  ///< camera samples of each pass after the first
    std::uint8_t step = 0;                           ///< kind passes only: FrameStep at which the frame stopped
};

struct FrameAccount {
    FrameStep step = FrameStep::refined;
    bool timed = false;          ///< the clock chose the passes
    bool coarsest_late = false;  ///< even the coarsest image took longer than the time
    std::uint64_t samples = 0;   ///< camera samples of the passes that count
    std::uint64_t rays = 0;      ///< of all kinds except subpixel bodies', of the passes that count
    std::uint64_t rays_discarded = 0;
    std::array<std::uint32_t, kMaxPasses> passes{};  ///< camera samples of each pass after the first; 0: none
    /// Root mean square over the pixels of the standard error of a pixel's mean band, W m^-2 sr^-1; negative: not
    /// estimated.
    double standard_error = -1;
    PhaseTimes phase_ns{};  ///< if FrameSettings::times is set
};

/// Switches for optimisations that do not change the mean; all on by default. `narpa bench render --ablation`
/// switches them off one at a time and measures the gain of each (docs/performance.md).
struct Mechanisms {
    bool sample_plan = true;   ///< adaptive sampling; off: the same number of samples for every pixel
    bool edge_classes = true;  ///< pixels next to an edge share its weight; off: each pixel's own contrast only
    bool path_reuse = true;    ///< path_reuse.h; off: each path serves its own pixel
    bool small_body_sampling = true;  ///< small_body_sampling.h; off: BSDF sampling only
    bool separate_sun =
        true;  ///< more samples for direct sunlight at first hits, and for emission in view, than for paths
    bool tile_culling = true;  ///< tile_culling.h; off: every tile is traced against every body
};

struct FrameSettings {
    int spp = 1;             ///< 1: the ray through each pixel's centre
    std::uint64_t seed = 0;  ///< scene seed; samples depend only on (seed, frame, pixel, sample)
    std::uint32_t frame = 0;
    RenderSettings::Method method = RenderSettings::Method::direct;
    int max_depth = 8;                                ///< of method path
    std::atomic<std::size_t>* pixels_done = nullptr;  ///< counted up while the frame is rendered; may be null
    FrameBudget budget{};                             ///< kind samples: spp
    bool times = false;                               ///< measure the time per phase: FrameAccount::phase_ns
    Mechanisms mechanisms{};
};

}  // namespace narpa
