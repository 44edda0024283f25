/// apps/commands/calibration.h - calibration of the sensors for navigation software, in formats that other software
/// reads.
#pragma once

#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// Writes DIR/CAMERA.yaml for each camera (camera_info of ROS) and DIR/calibration.json with all cameras and
/// LiDARs (matrix, distortion, and the mount as a body and a pose on it) and the marks of all bodies.
Status write_calibration(const Scene& scene, const std::string& folder);

}  // namespace narpa::cli
