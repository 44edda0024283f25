#include "emulator/sensor_kind.h"

#include <array>

#include "emulator/camera/camera_sensor.h"
#include "emulator/lidar/lidar_sensor.h"

namespace narpa {

std::span<const SensorKind> sensor_kinds() noexcept {
    static constexpr std::array<SensorKind, 2> kKinds{{{"camera", open_cameras}, {"lidar", open_lidars}}};
    return kKinds;
}

}  // namespace narpa
