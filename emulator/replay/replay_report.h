/// emulator/replay/replay_report.h - what a replay has found, as tables, JSON and a picture.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emulator/replay/replay.h"

namespace narpa {

/// A frame rendered again.
struct ReplayedFrame {
    LoggedFrame logged;
    std::vector<std::string> differs;             ///< from the log; empty: it repeats bit for bit
    std::optional<ReferenceComparison> compared;  ///< where a reference was requested

    /// RMSE after subtraction of the reference's own error (in squares), as a fraction of full scale.
    [[nodiscard]] double measured_error() const noexcept;
    /// Ratio of the frame's own estimate to the measured error; empty without an estimate, or where the measured
    /// error is 0.
    [[nodiscard]] std::optional<double> predicted_over_measured() const noexcept;
};

/// What the budget cost over all frames compared. Radiances as fractions of full scale.
struct BudgetCost {
    std::size_t frames = 0;
    double rmse = 0, rmse_largest = 0;  ///< over all pixels of all frames; of one frame
    double bias = 0;                    ///< mean
    double reference_error = 0;         ///< root mean square
    double ssim_mean = 1, ssim_min = 1;
    ShiftStatistics edges;   ///< of all frames; p99 of the worst
    std::size_t bodies = 0;  ///< centroids measured
    double bodies_x_px = 0, bodies_y_px = 0, bodies_rms_px = 0, bodies_largest_px = 0;  ///< mean; RMS; largest
    std::optional<double>
        predicted_over_measured;  ///< root mean squares of both, over frames that have an estimate
};
[[nodiscard]] BudgetCost budget_cost(std::span<const ReplayedFrame> frames);

[[nodiscard]] nlohmann::json to_json(const ReplayedFrame& frame, const Scene& scene);
[[nodiscard]] nlohmann::json to_json(const BudgetCost& cost);
/// A line for each frame, and the cost over all.
[[nodiscard]] std::string to_text(std::span<const ReplayedFrame> frames, const BudgetCost& cost);

/// Plots (plot/plot.h) the frame, its reference and their difference, side by side.
[[nodiscard]] Status plot_replay(const std::string& path, const std::string& title, const ReplayedFrame& frame,
                                 const RadianceImage& picture, const RadianceImage& reference);

}  // namespace narpa
