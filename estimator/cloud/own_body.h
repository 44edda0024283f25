/// estimator/cloud/own_body.h - removes from a sweep what the LiDAR sees of the body that carries it.
#pragma once

#include "estimator/cloud/range_points.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

/// Removes the beams, with and without return, that meet the body on which the LiDAR is mounted. Its place in the
/// LiDAR's axes is known.
void remove_own_body(const Tracer& tracer, const Lidar& lidar, LidarSweep& sweep);

}  // namespace narpa
