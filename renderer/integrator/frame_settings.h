/// renderer/integrator/frame_settings.h - how a frame is rendered, what it may cost, and what became of it.
///
/// A frame is made in passes. The first takes one sample for each pixel; where even that may not fit, the frame
/// goes from coarse to fine, so that there is a whole image from its first fraction on. With the Sun as the only
/// light the first samples are the pixels' centres. Their contrasts decide where further samples go, and they are
/// discarded there: numbers of samples that depend on these samples bias the mean (D. Kirk, J. Arvo, "Unbiased
/// sampling techniques for image synthesis", SIGGRAPH 1991). All other light gets uniform passes, of which all
/// samples count. Where the Sun is the only source of direct light and the budget is large enough, the centres come
/// first here too; after the uniform passes their contrasts decide where further samples of that sunlight go. The
/// number of samples of a pass is fixed before it begins, and a pass that does not end in time is discarded whole.
/// So a frame follows from the scene, the poses, its number, the seed and the sizes of its passes: the clock only
/// chooses these.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "renderer/scene/scene.h"

namespace narpa {

inline constexpr std::size_t kMaxPasses = 8;  ///< after the first
/// Frames by paths with separate direct sunlight: the pass of samples of that alone.
inline constexpr std::size_t kSunlightPass = kMaxPasses - 1;

/// How far a frame got, best first. Stated in its ledger.
enum class FrameStep : std::uint8_t {
    refined,      ///< more samples, or spp of them
    one_sample,   ///< one sample of each pixel: its centre, or the first of its sequence
    no_indirect,  ///< the pixels' centres, by direct light alone where the scene asks for paths
    coarse_2,     ///< one pixel in 2 x 2, by direct light
    coarse_4,     ///< one pixel in 4 x 4
    nothing,      ///< none: the image is as it was before
};

struct FrameBudget {
    enum class Kind : std::uint8_t {
        samples,  ///< FrameSettings::spp for each pixel, in one pass
        rays,     ///< at most this many rays, those of subpixel bodies not counted; same bytes under any load
        time,     ///< the radiance is there at the deadline
        passes,   ///< those of an account: to make the same frame again
    };
    Kind kind = Kind::samples;
    std::uint64_t rays = 0;
    std::int64_t deadline_ns = 0;                    ///< CLOCK_MONOTONIC
    std::array<std::uint32_t, kMaxPasses> passes{};  ///< camera samples of each pass after the first
    std::uint8_t step = 0;                           ///< of kind passes: FrameStep at which the frame stopped
};

/// Where the time goes, ns, summed over the threads.
enum class Phase : std::uint8_t { aim, rays, shading, shadow_rays, indirect, passes };
inline constexpr std::size_t kPhases = 6;
using PhaseTimes = std::array<std::int64_t, kPhases>;

struct FrameAccount {
    FrameStep step = FrameStep::refined;
    std::uint64_t samples = 0;  ///< through the camera, of the passes that count
    std::uint64_t rays = 0;     ///< of all kinds but subpixel bodies', of the passes that count
    std::uint64_t rays_discarded = 0;
    std::array<std::uint32_t, kMaxPasses> passes{};  ///< camera samples of each pass after the first; 0: none
    /// Root mean square over the pixels of the standard error of a pixel's mean band, W m^-2 sr^-1; negative: not
    /// estimated.
    double standard_error = -1;
    PhaseTimes phase_ns{};  ///< where FrameSettings::times asks for it
};

/// Switches for what makes frames faster without changing their mean: all on in the product. `narpa bench render
/// --ablation` switches them off one at a time and measures what each earns (docs/performance.md).
struct Mechanisms {
    bool sample_plan = true;   ///< adaptive sampling; off: the same number of samples for every pixel
    bool edge_classes = true;  ///< pixels next to an edge share its weight; off: each pixel's own contrast alone
    bool path_reuse = true;    ///< path_reuse.h; off: each path serves its own pixel
    bool small_body_sampling = true;  ///< small_body_sampling.h; off: BSDF sampling alone
    bool separate_sun = true;         ///< more samples for direct sunlight at first hits than for paths
    bool tile_culling = true;         ///< tile_culling.h; off: every tile is traced against every body
    bool coarse_steps = true;         ///< frames from coarse to fine where time is short; off: full resolution
};

struct FrameSettings {
    int spp = 1;             ///< 1: the ray through each pixel's centre
    std::uint64_t seed = 0;  ///< scene seed; samples depend on (seed, frame, pixel, sample) and nothing else
    std::uint32_t frame = 0;
    RenderSettings::Method method = RenderSettings::Method::direct;
    int max_depth = 8;                                ///< of method path
    std::atomic<std::size_t>* pixels_done = nullptr;  ///< counted up while the frame is rendered; may be null
    FrameBudget budget{};                             ///< kind samples: spp
    bool times = false;                               ///< measure where the time goes: FrameAccount::phase_ns
    Mechanisms mechanisms{};
};

}  // namespace narpa
