/// renderer/scene/lidar_sunlight.h - which LiDARs see sunlight.
#pragma once

#include "protocols/lidar/lidar_model.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Whether sunlight affects the noise or is a quantity of the packets.
[[nodiscard]] inline bool sees_sunlight(const Lidar& lidar) {
    return lidar.receiver.sunlight_noise > 0 || (lidar.model && lidar.model->spec().measures_sunlight);
}

}  // namespace narpa
