/// renderer/trajectory/trajectory_description.h - a trajectory made of files in the formats of flight
/// dynamics: TOML that names orbit and attitude ephemerides (CCSDS OEM, AEM) and tables, and says what their
/// columns mean.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/keys/keys.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa {

extern const TableKeys kTrajectoryFileKeys;

/// Rows of all bodies at equal steps, sorted by time. Errors name the file that is wrong, its line and column.
Result<std::vector<TrajectoryRow>> read_trajectory_description(const std::string& path);

}  // namespace narpa
