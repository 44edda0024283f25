/// renderer/lidar/lidar_shot.h - shots of a LiDAR or any other range finder, and their returns.
#pragma once

#include <span>

#include "renderer/geometry/tracer.h"

namespace narpa {

struct LidarReturn {
    double range_m = 0;      ///< 0: no return
    float reflectivity = 0;  ///< diffuse reflectance seen along the beam: pi * BRDF(-d, -d) * cos(incidence), mean
                             ///< of bands
    int body = -1;
};
/// A batch of shots, each at its own time. Writes the first beams.n returns.
void shoot(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, double range_max_m,
           std::span<LidarReturn> returns) noexcept;
[[nodiscard]] LidarReturn shoot(const Tracer& tracer, const BodyPoses& at, const Ray& beam,
                                double range_max_m) noexcept;

}  // namespace narpa
