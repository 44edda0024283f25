/// bench/gates.h - results of `narpa bench render --scenes` and their bounds.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/budget_ladder.h"
#include "bench/ratios.h"

namespace narpa {

/// One scene.
struct SceneLadder {
    std::string scene;
    int width = 0, height = 0, reference_spp = 0;
    double speed_up_least = 0;  ///< required over the plain loop; 0: not judged
    double speed_up_from = 0;   ///< judged over budgets of at least so many rays a pixel
    Ladder ladder;
};
/// Frames that the craft covers: 1 % of from afar, with triangles finer than the pixels; 1 % of at its edge, and
/// all of, both from near by through one lens. Medians, seconds.
struct EmptySpace {
    double far_s = 0, edge_s = 0, filled_s = 0;
};
/// Of the craft at full size.
struct CraftRatios {
    FrameCost cost, far;
    EmptySpace space;
    TwoFrames still_and_moved;
    double load_s = 0;
};

/// Bounds: times of a frame to those of Embree's calls on its rays; of 1 % cover to full cover, triangles as
/// large; seconds that moved bodies cost; seconds to the first frame; predicted to measured error.
inline constexpr double kToRawMost = 1.6, kEdgeMost = 0.04, kMovedMost_s = 1e-3, kLoadMost_s = 0.3;
inline constexpr double kPredictedLeast = 0.85, kPredictedMost = 1.40;

/// Bounds that are missed, one sentence each. A rung without a predicted error is one of them, unless its frames
/// left out pixels or indirect light.
[[nodiscard]] std::vector<std::string> bench_faults(const SceneLadder& scene);
[[nodiscard]] std::vector<std::string> bench_faults(const CraftRatios& ratios);

}  // namespace narpa
