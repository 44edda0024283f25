/// renderer/lidar/lidar_shot.h - one shot of a LiDAR or any other range finder, and its return.
#pragma once

#include "renderer/geometry/tracer.h"

namespace narpa {

/// What comes back of a shot.
struct LidarReturn {
    double range_m = 0;  ///< 0: no return
    float reflectivity =
        0;  ///< diffuse reflectance seen along the beam: pi * BRDF(-d, -d) * cos(incidence), mean of bands
    int body = -1;
};
/// One ray; its bodies where they are at the shot's own time.
[[nodiscard]] LidarReturn shoot(const Tracer& tracer, const BodyPoses& at, const Ray& beam,
                                double range_max_m) noexcept;

}  // namespace narpa
