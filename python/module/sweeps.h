/// python/module/sweeps.h - sweeps from Python as measurements of an estimator.
#pragma once

#include <pybind11/numpy.h>

#include <cstdint>
#include <string>
#include <vector>

#include "estimator/cloud/range_points.h"

namespace narpa::python {

/// From an array of shots (shots_dtype): what the LiDAR reports, before the rounding of its packets, along the
/// beams of its model. Times count from t_ns. Raises narpa.Error for other arrays.
[[nodiscard]] LidarSweep sweep_of_shots(const pybind11::array& shots, const LidarModel& model, std::int64_t t_ns);

/// From the data packets of one turn; times count from the earliest. Raises narpa.Error for other bytes.
[[nodiscard]] LidarSweep sweep_of_packets(const std::vector<std::string>& packets, const LidarModel& model);

}  // namespace narpa::python
