/// apps/commands/check_sensors.h - usual mistakes with a scene's sensors: inside their hull, wrongly exposed.
#pragma once

#include <nlohmann/json.hpp>

#include "emulator/world.h"

namespace narpa::cli {

/// Prints which share of a sensor's rays meets the body that carries it, and warns of much. Adds `own_hull_share`
/// and `own_hull_nearest_m` to the document's cameras and LiDARs.
void check_own_hulls(const World& world, nlohmann::json& document);
/// Prints signal levels of each camera at time 0, and warns of useless ones. Adds `signal` to the cameras.
void check_exposures(const World& world, nlohmann::json& document);

}  // namespace narpa::cli
