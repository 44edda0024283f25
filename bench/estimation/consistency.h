/// bench/estimation/consistency.h - whether poses that the estimators report as good are correct: random scenes,
/// conditions and starts with known true poses; on request with a world that differs from the estimators' model.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "emulator/threads.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "protocols/estimate.h"

namespace narpa {

/// `icp-search`: LiDAR without a guess.
inline constexpr std::array<std::string_view, 5> kConsistencyMethods{"points", "features", "dense", "icp",
                                                                     "icp-search"};
/// How a measurement is disturbed. `wrong`: it shows another target.
inline constexpr std::array<std::string_view, 7> kConsistencyConditions{"plain",  "bright", "dark", "blurred",
                                                                        "beside", "wrong",  "far"};

struct ConsistencyOptions {
    std::vector<std::string> methods{kConsistencyMethods.begin(), kConsistencyMethods.end()};
    std::vector<std::string> targets;     ///< as in consistency_scenes.h; empty: all that are made in code
    std::vector<std::string> conditions;  ///< empty: all
    /// Names of kinds of untold_errors.h; "all": each of them. Then each frame has one of them in one of its sizes
    /// instead of a condition, and dense is not given the frame's sampling noise, as in `narpa estimate`. Methods
    /// of frames only.
    std::vector<std::string> untold{};
    int trials = 200;                         ///< of each method
    int size = 96;                            ///< pixels of the camera
    double start_deg = 5, start_percent = 5;  ///< the largest error of a start; each is drawn below it
    std::uint64_t seed = 1;
    ModelUncertainty world;  ///< errors of the believed model, drawn with these standard deviations for each trial
    double distortion = 0;   ///< k1 of the world's lens, which the estimators do not know
    ModelUncertainty told;   ///< the uncertainty that the estimators are given
};

struct ConsistencyRow {
    std::string method, target, condition;
    std::array<int, kAnswerKinds.size()> answers{};
    int beyond = 0;                                       ///< good answers beyond 6 sigma: NEES above kSixSigmaNees
    std::vector<double> nees;                             ///< of the good answers
    std::vector<double> rotation_rad, position_of_range;  ///< their errors
    std::vector<int> beyond_trials;                       ///< their numbers, to repeat them

    void add(const ConsistencyRow& other);
    [[nodiscard]] int trials() const { return answers[0] + answers[1] + answers[2] + answers[3]; }
};

/// One for each method, target and condition that was drawn. `first`: number of the first trial; a trial depends on
/// its number, the seed and the options alone. Errors: an unknown target.
[[nodiscard]] Result<std::vector<ConsistencyRow>> run_consistency(
    const ConsistencyOptions& options, int first, TracingThreads& threads,
    const std::function<void(const std::string&)>& progress, const StopFlag& stop);

[[nodiscard]] nlohmann::json to_json(const std::vector<ConsistencyRow>& rows);
/// Tables by method, by method and target, and by method and condition.
[[nodiscard]] std::string to_text(const std::vector<ConsistencyRow>& rows);

}  // namespace narpa
