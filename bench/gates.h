/// bench/gates.h - results of `narpa bench render --scenes` and their bounds.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bench/budget_ladder.h"
#include "bench/embree/raw_embree.h"
#include "emulator/threads.h"
#include "emulator/world.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Medians, seconds.
struct FrameCost {
    double frame_s = 0;  ///< from poses to bytes: radiance, detector, conversion
    double radiance_s = 0, detector_s = 0, hand_over_s = 0;  ///< hand-over: one copy of the bytes
    PhaseTimes phase_ns{};                                   ///< of one frame, all threads
    RawCost raw;
    [[nodiscard]] double to_raw() const { return frame_s / raw.seconds(); }
};

/// Frame times of the craft at full size, by direct light with one sample a pixel. Medians, seconds.
struct CraftRatios {
    FrameCost near, far;  ///< of those cameras, beside Embree's calls on the same rays
    /// Radiance times of frames of which the craft covers 1 %, from afar, with triangles finer than the pixels
    /// (far); 1 %, at its edge (edge); and all (filled). Edge and filled have the same position and lens. Without
    /// the detector, which adds noise to every pixel.
    double far_s = 0, edge_s = 0, filled_s = 0;
    /// With all bodies at rest, and with each of them moved in every frame (by 0.1 mm and 0.01 mrad, so that the
    /// image stays the same).
    double still_s = 0, moved_s = 0;
    double load_s = 0;  ///< from the name of the file to the first frame's bytes
};

/// `load` reads the scene as the bench has it, with cameras near, far, edge and filled. `rounds`: number of frames
/// of a median; `loads`: number of first frames of a median. Errors: `load`'s; no such camera; bodies that are not
/// triangles.
[[nodiscard]] Result<CraftRatios> measure_ratios(const std::function<Result<Scene>()>& load, int rounds, int loads,
                                                 TracingThreads& threads,
                                                 const std::function<void(const std::string&)>& progress);

/// One scene.
struct SceneLadder {
    std::string scene;
    int width = 0, height = 0, reference_spp = 0;
    double speed_up_min = 0;   ///< required over the plain loop; 0: not judged
    double speed_up_from = 0;  ///< judged over budgets of at least so many rays a pixel
    Ladder ladder;
};
/// Bounds: time of a frame over that of Embree's calls on its rays; time at 1 % cover over that at full cover, with
/// equally large triangles; seconds that moved bodies add; seconds to the first frame; predicted over measured
/// error.
inline constexpr double kToRawMost = 1.6, kEdgeMost = 0.032, kMovedMost_s = 1e-3, kLoadMost_s = 0.3;
inline constexpr double kPredictedLeast = 0.85, kPredictedMost = 1.40;
/// The same of frames with less than one sample per pixel.
inline constexpr double kFilledPredictedLeast = 0.7, kFilledPredictedMost = 1.5;

/// Bounds that are missed, one sentence each. A rung without a predicted error is one of them, unless its frames
/// left out pixels or indirect light.
[[nodiscard]] std::vector<std::string> bench_faults(const SceneLadder& scene);
[[nodiscard]] std::vector<std::string> bench_faults(const CraftRatios& ratios);

}  // namespace narpa
