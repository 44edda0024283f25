/// renderer/light/atmosphere.h - a planet's air as a medium: it attenuates light, that of the Sun included,
/// scatters sunlight towards the viewer (sky, aerial perspective, limb, twilight), and lights surfaces from all
/// sides.
///
/// An ellipsoid's air follows the ellipsoid: positions are scaled to a sphere of radius `ground_radius_m`, which
/// changes lengths by up to the flattening, 0.3 % for the Earth. Rays are straight; refraction is handled for
/// apparent positions (renderer/atmosphere/refraction/refraction.h).
#pragma once

#include <memory>
#include <optional>

#include "renderer/atmosphere/refraction/ray_bundle.h"
#include "renderer/light/medium.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Transforms between the world and the sphere of a planet's air.
struct Planet {
    std::size_t body = 0;
    Vec3 scale{1, 1, 1};

    explicit Planet(const Scene& scene);

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
    [[nodiscard]] Frame at(const BodyPoses& poses, double time) const noexcept {
        return {poses.T_world_body_at(body, time), scale};
    }
};

class AtmosphereMedium final : public Medium {
public:
    /// `scene` has an atmosphere. Computes its tables on this many threads (0: all).
    AtmosphereMedium(const Scene& scene, int threads);

    [[nodiscard]] MediumSegment along(const BodyPoses& at, const Ray& ray, double range_m,
                                      double u) const noexcept override;
    [[nodiscard]] bool uses_random_numbers() const noexcept override { return false; }
    /// Camera rays from one origin are interpolated (renderer/atmosphere/refraction/ray_bundle.h).
    void along_each(const BodyPoses& at, std::span<const MediumRay> rays,
                    std::span<MediumSegment> segments) const noexcept override;
    [[nodiscard]] Rgb transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept override;
    [[nodiscard]] Rgb ambient(const BodyPoses& at, const Vec3& position, const Vec3& normal,
                              double time) const noexcept override;
    [[nodiscard]] std::shared_ptr<const LidarMedium> for_lidar() const override { return lidar_; }
    [[nodiscard]] int body() const noexcept override { return static_cast<int>(planet_.body); }

private:
    [[nodiscard]] MediumSegment segment(const AirLight& light) const noexcept;

    Planet planet_;
    std::optional<Sun> sun_;
    ScatteredLight light_;
    std::unique_ptr<AirCache> cells_ = std::make_unique<AirCache>();  ///< cache shared by frames
    std::shared_ptr<const LidarMedium> lidar_;
};

}  // namespace narpa
