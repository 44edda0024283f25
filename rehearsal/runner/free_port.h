/// rehearsal/runner/free_port.h - where a LiDAR's packets go.
#pragma once

#include "base/result.h"

namespace narpa::rehearsal {

/// A free UDP data port of the loopback, low enough for the port of the position packets above it.
[[nodiscard]] Result<int> free_lidar_port();

}  // namespace narpa::rehearsal
