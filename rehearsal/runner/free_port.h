/// rehearsal/runner/free_port.h - where a LiDAR's packets go.
#pragma once

#include "base/result.h"

namespace narpa::rehearsal {

/// A UDP data port of the loopback that nobody has now; position packets go to the port 5940 above it.
[[nodiscard]] Result<int> free_lidar_port();

}  // namespace narpa::rehearsal
