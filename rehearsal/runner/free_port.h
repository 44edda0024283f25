/// rehearsal/runner/free_port.h - finds a UDP port for a LiDAR's packets.
#pragma once

#include "base/result.h"

namespace narpa::rehearsal {

/// A free UDP data port on the loopback interface, low enough for the position packets' port above it.
[[nodiscard]] Result<int> free_lidar_port();

}  // namespace narpa::rehearsal
