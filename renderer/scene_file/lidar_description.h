/// renderer/scene_file/lidar_description.h - reads LiDAR descriptions in TOML: docs/lidar-description.md.
#pragma once

#include <string>

#include "base/result.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/keys/keys.h"

namespace narpa {

extern const TableKeys kLidarDescriptionKeys;

/// Errors name the file and the line, and what was expected.
[[nodiscard]] Result<LidarMake> read_lidar_description(const std::string& file);

}  // namespace narpa
