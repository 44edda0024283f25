/// emulator/cli/bench_ladder.h - `narpa bench render --scenes`: what budgets buy on the standing scenes, and the
/// ratios that frames are judged by.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "emulator/bench_ratios.h"
#include "emulator/budget_ladder.h"
#include "emulator/cli/cli.h"

namespace narpa::cli {

struct LadderOptions {
    std::vector<std::string> scenes;

    int threads = 0;
    bool quick = false, gates = false;
};

/// The names that --scenes takes.
[[nodiscard]] std::vector<std::string> standing_scenes();

Outcome bench_ladder(const LadderOptions& options);

/// One scene, measured.
struct LadderOf {
    std::string scene;
    int width = 0, height = 0, reference_spp = 0;
    double speed_up_least = 0;  ///< that the scene must reach; 0: the loop is not set beside it
    Ladder ladder;
};
/// Of the craft at full size.
struct CraftRatios {
    FrameCost cost;
    TwoFrames far_and_filled, still_and_moved;
    double load_s = 0;
};

/// Bounds: times of a frame to those of Embree's calls on its rays; of 1 % cover to full cover; seconds that moved
/// bodies cost; seconds to the first frame; predicted to measured error.
inline constexpr double kToRawMost = 1.6, kFarMost = 0.04, kMovedMost_s = 1e-3, kLoadMost_s = 0.3;
inline constexpr double kHonestyLeast = 0.85, kHonestyMost = 1.40;

/// The median of the speed-ups over the loop of the ladder's budgets in rays, or of its spp where these have none.
[[nodiscard]] std::optional<double> typical_speed_up(const Ladder& ladder);
[[nodiscard]] std::vector<std::string> ladder_faults(const std::vector<LadderOf>& ladders,
                                                     const std::optional<CraftRatios>& ratios);
void tell_ladder(const LadderOf& l);
void tell_ratios(const CraftRatios& r);
[[nodiscard]] nlohmann::json describe(const LadderOf& l);
[[nodiscard]] nlohmann::json describe(const CraftRatios& r);

}  // namespace narpa::cli
