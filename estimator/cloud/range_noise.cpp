#include <cmath>

#include "estimator/cloud/range_points.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Of the mean of a few rays over a beam: the distance of their centre from the axis, on each of two axes, in parts
/// of the beam's angle. Eight rays; 32 have 0.006.
constexpr double kFootprintCentre = 0.02;

RangeNoise range_noise_of(const Lidar& lidar) {
    RangeNoise noise;
    const LidarReceiverModel& r = lidar.receiver;
    const double modelled_m = std::hypot(r.range_noise_m, r.range_noise_at_limit_m);
    if (modelled_m > 0)
        noise.range_m = std::hypot(modelled_m, lidar.model->spec().range_resolution_m / std::sqrt(12.0));
    noise.footprint_rad = r.beam_divergence_rad;
    noise.pointing_rad = std::hypot(noise.pointing_rad, kFootprintCentre * r.beam_divergence_rad);
    return noise;
}

}  // namespace narpa
