/// renderer/integrator/frame_budget.h - what a frame may cost, and what became of it.
///
/// A frame is made in passes. The first takes one sample for each pixel; where even that may not fit, the frame
/// goes from coarse to fine, so that there is a whole image from its first fraction on. With the Sun as the only
/// light the first samples are the pixels' centres; their contrasts decide where further samples go, and they are
/// discarded there, as numbers of samples that depend on these samples bias the mean (D. Kirk, J. Arvo, "Unbiased
/// sampling techniques for image synthesis", SIGGRAPH 1991). All other light gets uniform passes, of which all
/// samples count. Each pass has its number of samples fixed before it begins, and one that does not end in time is
/// discarded whole. So a frame follows from the scene, the poses, its number, the seed and the sizes of its passes:
/// the clock only chooses these.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace narpa {

inline constexpr std::size_t kMaxPasses = 8;  ///< after the first

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
    std::array<std::uint32_t, kMaxPasses> passes{};  ///< camera samples of each pass after the first, then 0
    /// Root mean square over the pixels of the standard error of a pixel's mean band, W m^-2 sr^-1; negative: not
    /// estimated.
    double standard_error = -1;
    PhaseTimes phase_ns{};  ///< where FrameSettings::times asks for it
};

}  // namespace narpa
