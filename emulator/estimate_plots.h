/// emulator/estimate_plots.h - what the benches of ICP and filter found, as pictures.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/filter_bench.h"
#include "emulator/icp_bench.h"

namespace narpa {

/// Writes a PNG: the part of the starts that found the pose, a field for each angle and part of the distance.
[[nodiscard]] Status write_icp_plot(const std::string& path, const std::string& title,
                                    const std::vector<IcpRun>& runs);
/// Writes a PNG with a panel for each case: NEES over time with its 95 % band.
[[nodiscard]] Status write_filter_plot(const std::string& path, const std::string& title,
                                       const std::vector<FilterRun>& runs);

}  // namespace narpa
