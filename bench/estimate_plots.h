/// bench/estimate_plots.h - what the benches of the estimators found, as pictures.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "bench/filter.h"
#include "bench/icp.h"

namespace narpa {

/// Writes a PNG: the part of the starts that found the pose, a field for each angle and part of the distance.
[[nodiscard]] Status write_icp_plot(const std::string& path, const std::string& title,
                                    const std::vector<IcpRun>& runs);
/// Writes a PNG with a panel for each case: NEES over time with its 95 % band.
[[nodiscard]] Status write_filter_plot(const std::string& path, const std::string& title,
                                       const std::vector<FilterRun>& runs);

/// One estimator: what an estimate takes and how far off it is.
struct TimeAndError {
    std::string name;
    std::string family;            ///< has one colour
    double ms = 0;                 ///< an estimate, median
    double position_of_range = 0;  ///< RMS error of the position, as a part of the range
};
/// Writes a PNG: error over time, both in decades, each estimator a dot with its name.
[[nodiscard]] Status write_time_plot(const std::string& path, const std::vector<TimeAndError>& estimators);

}  // namespace narpa
