/// renderer/light/atmosphere.h - a planet's air as a medium: it attenuates light, that of the Sun included,
/// scatters sunlight towards the viewer (sky, aerial perspective, limb, twilight), and lights surfaces from all
/// sides.
///
/// An ellipsoid's air follows the ellipsoid: positions are scaled to a sphere of radius `ground_radius_m`, which
/// changes lengths by up to the flattening, 0.3 % for the Earth. Rays are straight; refraction is handled for
/// apparent positions (renderer/atmosphere/refraction.h).
#pragma once

#include <memory>
#include <optional>

#include "renderer/atmosphere/lidar_air.h"
#include "renderer/atmosphere/ray_bundle.h"
#include "renderer/light/medium.h"
#include "renderer/scene/scene.h"

namespace narpa {

class AtmosphereMedium final : public Medium {
public:
    /// `scene` has an atmosphere. Computes its tables on this many threads (0: all).
    AtmosphereMedium(const Scene& scene, int threads);

    [[nodiscard]] MediumSegment along(const BodyPoses& at, const Ray& ray, double range_m,
                                      double u) const noexcept override;
    [[nodiscard]] bool uses_random_numbers() const noexcept override { return false; }
    /// Camera rays from one origin are interpolated (renderer/atmosphere/ray_bundle.h).
    void along_each(const BodyPoses& at, std::span<const MediumRay> rays,
                    std::span<MediumSegment> segments) const noexcept override;
    [[nodiscard]] Rgb transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept override;
    [[nodiscard]] Rgb ambient(const BodyPoses& at, const Vec3& position, const Vec3& normal,
                              double time) const noexcept override;
    [[nodiscard]] double lidar_transmittance(const BodyPoses& at, const Ray& ray,
                                             double range_m) const noexcept override;
    /// 0 unless a LiDAR of the scene sees sunlight.
    [[nodiscard]] double lidar_in_scattering(const BodyPoses& at, const Ray& ray, double range_m,
                                             double u) const noexcept override;
    [[nodiscard]] Backscatter lidar_backscatter(const BodyPoses& at, const Ray& ray, double from_m,
                                                double to_m) const noexcept override;
    [[nodiscard]] double max_lidar_backscatter_1_m() const noexcept override { return lidar_air_.max_1_m(); }
    [[nodiscard]] int body() const noexcept override { return static_cast<int>(body_); }

private:
    /// Transforms world coordinates to the planet's sphere.
    struct Frame {
        Rigid3 T_world_planet;
        Vec3 scale;
        [[nodiscard]] Vec3 point(const Vec3& world) const {
            return scale * (conjugate(T_world_planet.q) * (world - T_world_planet.t));
        }
        /// Not unit: its length is the scaled length of one metre.
        [[nodiscard]] Vec3 direction(const Vec3& world) const {
            return scale * (conjugate(T_world_planet.q) * world);
        }
    };
    [[nodiscard]] Frame frame_at(const BodyPoses& at, double time) const noexcept;
    [[nodiscard]] std::optional<Vec3> to_sun(const Frame& frame) const noexcept;
    [[nodiscard]] MediumSegment segment(const AirLight& light) const noexcept;

    std::size_t body_;
    Vec3 scale_{1, 1, 1};
    std::optional<Sun> sun_;
    ScatteredLight light_;
    std::unique_ptr<AirCache> cells_ = std::make_unique<AirCache>();  ///< cache shared by frames
    LidarAir lidar_air_;
    std::optional<ScatteredLight> lidar_light_;  ///< at the wavelength of LiDARs
};

}  // namespace narpa
