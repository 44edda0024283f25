/// renderer/assets/lidar_calibration.h - a LiDAR's own beam angles, as ROS keeps them.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa {

/// YAML of ROS's velodyne_pointcloud: `lasers`, each with laser_id, vert_correction and rot_correction (rad; the
/// latter is subtracted from the azimuth), dist_correction and vert_offset_correction (m). Returns as many as
/// `beams`, by laser_id. Errors name the file and the line: lasers that are missing or twice, horizontal offsets.
/// `warnings`: where sentences go about what the file states and is not used (corrections of range and intensity).
[[nodiscard]] Result<std::vector<LidarBeam>> read_lidar_calibration(const std::string& file, std::size_t beams,
                                                                    std::vector<std::string>* warnings = nullptr);

}  // namespace narpa
