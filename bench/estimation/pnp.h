/// bench/estimation/pnp.h - poses from points: narpa's solver beside OpenCV's and Ceres's, error against the
/// Cramer-Rao bound, failures, and time.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "base/stop.h"
#include "estimator/pnp/pnp_points.h"

namespace narpa {

enum class PnpScene : std::uint8_t { nominal, half_turn, plane, plane_facing, line, tiny, camera_plane };
[[nodiscard]] const char* to_text(PnpScene scene);

struct PnpSetting {
    PnpScene scene = PnpScene::nominal;
    int points = 10;
    double noise_px = 0.5;
    double range_m = 30;
    double outliers = 0;  ///< fraction of the points whose pixels are uniform over the image
};

/// One trial. Camera of the paper: 500 x 500 pixels, 30 degrees across the diagonal.
struct PnpTrial {
    Pinhole camera;
    Rigid3 T_camera_body{};
    std::vector<Vec3> body_m;
    std::vector<Pixel> pixels;
    double sigma_px = 1;
    std::size_t inliers = 0;  ///< the first points
    /// The Cramer-Rao bound of the inliers: roots of the summed variances of rotation and position.
    double bound_rotation_rad = 0, bound_position_m = 0;

    [[nodiscard]] PnpInput input() const { return {&camera, body_m, pixels, sigma_px}; }
};

/// None where the points do not determine the pose or lie behind the camera: draw again.
[[nodiscard]] std::optional<PnpTrial> draw_trial(const PnpSetting& setting, std::mt19937_64& random);

struct PnpBenchOptions {
    int trials = 1000;  ///< of each cell; a fifth of it where half the points are outliers
    std::vector<int> points{4, 6, 10, 30, 100};
    std::vector<double> noise_px{0.1, 0.5, 1};
    std::vector<double> ranges_m{2, 10, 30, 100, 200};
    bool nominal = true;     ///< every number of points with every noise and range
    bool hard_cases = true;  ///< half a turn, planes, lines, far and near bodies, outliers
    std::uint64_t seed = 1;
};

/// One method in one cell. Errors are in units of the trial's own Cramer-Rao bound (the root of the summed
/// variances), of the trials that did not fail; efficient means an RMS of 1 and a median of about 0.88.
struct PnpRow {
    std::string method;
    int trials = 0;
    double rotation_median_bounds = 0, rotation_rms_bounds = 0;
    double position_median_bounds = 0, position_rms_bounds = 0;
    double failed = 0;   ///< part of the trials without a pose, or with an error above ten times either bound
    double flagged = 0;  ///< part of the failures that the solver itself called ambiguous or imprecise
    double median_us = 0;
};

/// All methods on the same trials, taking turns.
struct PnpCell {
    std::string name;  ///< "nominal", or the hard case
    int points = 0;
    double noise_px = 0, range_m = 0, outliers = 0;
    double bound_rotation_deg = 0,
           bound_position_of_range = 0;  ///< medians over trials; the latter as a part of the range
    std::vector<PnpRow> rows;

    [[nodiscard]] const PnpRow* row(const std::string& method) const;
};

/// Names of the rows that the verdict compares.
inline constexpr const char* kPnpCold = "narpa cold";
inline constexpr const char* kPnpWarm = "narpa warm";
inline constexpr const char* kPnpPeerCold = "SQPNP + Ceres LM";
inline constexpr const char* kPnpPeerWarm = "Ceres LM warm";
inline constexpr const char* kPnpPeerOutliers = "RANSAC EPNP + RefineLM";

/// `progress` is called before each cell with the cells done and the total. Returns the cells so far once `stop` is
/// set.
[[nodiscard]] std::vector<PnpCell> run_pnp_bench(const PnpBenchOptions& options,
                                                 const std::function<void(std::size_t, std::size_t)>& progress,
                                                 const StopFlag& stop);

/// Conclusions over all cells; ratios of times are of medians within a cell.
struct PnpVerdict {
    double worst_rms_bounds = 0;  ///< narpa cold, nominal cells with ten points or more: either RMS, in bounds
    int cells_with_more_failures =
        0;                          ///< cells where narpa cold fails more often than SQPNP and Ceres, beyond chance
    double cold_time_ratio = 0;     ///< worst nominal cell: narpa cold / (SQPNP + Ceres LM)
    double warm_time_ratio = 0;     ///< worst nominal cell: narpa warm / Ceres LM warm
    double outlier_time_ratio = 0;  ///< worst cell with 20 % outliers: narpa / RANSAC EPNP + RefineLM
};
[[nodiscard]] PnpVerdict judge(const std::vector<PnpCell>& cells);

[[nodiscard]] std::string to_text(const std::vector<PnpCell>& cells);
[[nodiscard]] std::string to_text(const PnpVerdict& verdict);
[[nodiscard]] nlohmann::json to_json(const std::vector<PnpCell>& cells);
[[nodiscard]] nlohmann::json to_json(const PnpVerdict& verdict);

}  // namespace narpa
