/// bench/estimation/filter.h - consistency of the pose filter: simulated flights, and the normalised estimation
/// error squared (NEES) over time.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "estimator/filter/pose_filter.h"

namespace narpa {

/// A target 30 m ahead that approaches and rotates, its attitude initially half a turn from the sensor's. Each
/// sensor measures the pose once a second, with errors drawn from its covariance.
struct FilterCase {
    std::string name;
    MotionModel motion{};
    bool camera = true, lidar = false;  ///< a camera: range ten times worse than direction; a LiDAR: all alike
    double lidar_late_s = 0;            ///< delay of its measurements
};
/// Free and in orbit, camera and LiDAR, and both of a tumbling target with delayed LiDAR measurements.
[[nodiscard]] std::vector<FilterCase> filter_cases();

struct FilterBenchSettings {
    int runs = 100;
    int seconds = 60;
};

inline constexpr int kFilterStates = 12;

struct FilterTime {
    double t_s = 0;
    double nees = 0;                                  ///< mean over the runs; twelve for a consistent filter
    double position_rms_m = 0, position_sigma_m = 0;  ///< true and predicted: three axes
    double attitude_rms_rad = 0, attitude_sigma_rad = 0;
};
struct FilterRun {
    std::string name;
    int runs = 0;
    std::vector<FilterTime> times;  ///< each second
    double nis = 0;                 ///< mean; six for a consistent filter
    std::uint64_t updates = 0, gated = 0;
    double update_microseconds = 0;  ///< time of the thread, mean, with the prediction before it

    /// Half the width of the band around twelve that holds 95 % of the means over so many runs.
    [[nodiscard]] double band() const;
    [[nodiscard]] double nees() const;         ///< mean over the times
    [[nodiscard]] double inside_band() const;  ///< part of the times
};

[[nodiscard]] std::vector<FilterRun> run_filter(const std::vector<FilterCase>& cases,
                                                const FilterBenchSettings& settings);

[[nodiscard]] nlohmann::json to_json(const std::vector<FilterRun>& runs);
/// A table, a line for each case.
[[nodiscard]] std::string to_text(const std::vector<FilterRun>& runs);

}  // namespace narpa
