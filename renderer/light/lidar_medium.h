/// renderer/light/lidar_medium.h - a participating medium at the wavelength of LiDARs: it dims their beams,
/// scatters sunlight into them, and sends light of the pulse back.
#pragma once

#include "renderer/geometry/tracer.h"

namespace narpa {

/// Thread-safe; allocates nothing when it is evaluated. Rays: world, metres.
class LidarMedium {
public:
    virtual ~LidarMedium() = default;

    /// One way, along the ray from its origin to range_m.
    [[nodiscard]] virtual double transmittance(const BodyPoses& at, const Ray& ray,
                                               double range_m) const noexcept = 0;
    /// Radiance of sunlight scattered along the ray, W m^-2 sr^-1; `u` as in Medium::along.
    [[nodiscard]] virtual double in_scattering(const BodyPoses& at, const Ray& ray, double range_m,
                                               double u) const noexcept = 0;
    /// Return of a pulse between two ranges, 0 < from_m < to_m: pi times the integral of backscatter *
    /// transmittance^2 / range^2, in units in which a diffuse surface returns reflectivity * transmittance^2 /
    /// range^2; and its mean range.
    struct Backscatter {
        double light = 0, range_m = 0;
    };
    [[nodiscard]] virtual Backscatter backscatter(const BodyPoses& /*at*/, const Ray& /*ray*/, double /*from_m*/,
                                                  double /*to_m*/) const noexcept {
        return {};
    }
    /// Pi times the largest backscatter coefficient anywhere, 1/m; 0: no backscatter.
    [[nodiscard]] virtual double max_backscatter_1_m() const noexcept { return 0; }
    /// The body that the medium moves with; -1: it is at rest.
    [[nodiscard]] virtual int body() const noexcept { return -1; }
};

}  // namespace narpa
