/// renderer/light/air_for_lidar.h - a planet's air at the wavelength of LiDARs.
#pragma once

#include <memory>
#include <optional>

#include "renderer/atmosphere/lidar_air.h"
#include "renderer/light/atmosphere.h"

namespace narpa {

class AirForLidar final : public LidarMedium {
public:
    /// `scene` has an atmosphere.
    AirForLidar(const Scene& scene, int threads);

    [[nodiscard]] double transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept override;
    /// 0 unless a LiDAR of the scene sees sunlight.
    [[nodiscard]] double in_scattering(const BodyPoses& at, const Ray& ray, double range_m,
                                       double u) const noexcept override;
    /// Lengths are not rescaled: the ellipsoid's scale changes them by 0.3 %.
    [[nodiscard]] Backscatter backscatter(const BodyPoses& at, const Ray& ray, double from_m,
                                          double to_m) const noexcept override;
    [[nodiscard]] double max_backscatter_1_m() const noexcept override { return air_.max_1_m(); }
    [[nodiscard]] int body() const noexcept override { return static_cast<int>(planet_.body); }

private:
    Planet planet_;
    std::optional<Sun> sun_;
    LidarAir air_;
    std::optional<ScatteredLight> sunlight_;
};

/// The air of a scene in which only LiDARs measure. For light it is a vacuum: the tables of scattered light,
/// seconds of work, are not made. `scene` has an atmosphere.
[[nodiscard]] std::unique_ptr<const Medium> air_for_lidars_alone(const Scene& scene, int threads = 0);

}  // namespace narpa
