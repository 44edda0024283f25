/// emulator/scene_sensors.h - the sensors of a scene for which the options name sinks. A new kind is opened here.
#pragma once

#include <memory>
#include <vector>

#include "emulator/emulator.h"

namespace narpa {

class CameraSensor;

/// `telemetry`: sensors keep ledgers for the CAN bus. `world` must outlive the sensors. Errors name sensor, sink or
/// file.
Result<std::vector<std::unique_ptr<Sensor>>> open_sensors(const World& world, const RunOptions& options,
                                                          bool telemetry);
/// The estimator that the options ask for, attached to its camera among `sensors`.
Result<std::unique_ptr<OnlineEstimator>> open_estimator(const World& world, const RunOptions& options,
                                                        const std::vector<std::unique_ptr<Sensor>>& sensors,
                                                        bool telemetry);

}  // namespace narpa
