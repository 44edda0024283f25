/// renderer/lidar/lidar_shot.h - shots of a LiDAR or any other range finder, and their returns.
#pragma once

#include <cstdint>
#include <span>

#include "renderer/geometry/tracer.h"
#include "renderer/light/lidar_medium.h"

namespace narpa {

struct LidarReturn {
    double range_m = 0;       ///< 0: no return. Along the whole path, mirrors included
    float reflectivity = 0;   ///< seen along the beam: pi * BRDF(-d, -d) * cos(incidence), mean of bands, and the
                              ///< retroreflectance * cos(incidence)
    int body = -1;            ///< the last on the path
    float cos_incidence = 0;  ///< at that hit
    double velocity_m_s = 0;  ///< of the material point along the line of sight; receding is positive
    float sunlight = 0;  ///< radiance of the surface towards the LiDAR, relative to a white one that faces the Sun
};

/// What is computed for shots besides range, reflectivity and body, and its inputs.
struct ShotSettings {
    double range_max_m = 0;      ///< no return from beyond
    bool multipath = false;      ///< a beam goes on from mirrors; else it ends there with a reflectivity of 0
    std::uint32_t sunlight = 0;  ///< a bit for each shot of the batch whose sunlight is wanted
    /// Of all bodies, for velocities; empty: they are not wanted.
    std::span<const Motion> motions{};
    int mount = -1;                           ///< body that the LiDAR rides on; -1: it is at rest
    std::span<const std::uint32_t> bodies{};  ///< all that the shots may meet before a mirror; empty: any may be
    const LidarMedium* medium = nullptr;      ///< dims the light on its way there and back; null: a vacuum
};

/// Velocity of a material point of a body by settings.motions, world; 0 for body -1.
[[nodiscard]] Vec3 velocity_at(const ShotSettings& settings, const BodyPoses& at, int body, const Vec3& point,
                               double time) noexcept;

/// Takes beams from the axes of a LiDAR to the world's, each at its own time. `mount`: the body that it rides on;
/// -1: it is at rest at T_mount_lidar.
void place_beams(const BodyPoses& at, int mount, const Rigid3& T_mount_lidar, RayBatch& beams) noexcept;

/// A batch of shots, each at its own time. Writes the first beams.n returns.
///
/// The velocity is d . (v_hit - v_sensor) of the material point, which is what Doppler measures: not the rate of
/// the range where a body turns. Light is taken as infinitely fast; relative error v / c.
void shoot(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, const ShotSettings& settings,
           std::span<LidarReturn> returns) noexcept;
/// The same. `hits`: out, what the shots meet first.
void shoot(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, const ShotSettings& settings,
           std::span<LidarReturn> returns, HitBatch& hits) noexcept;
[[nodiscard]] LidarReturn shoot(const Tracer& tracer, const BodyPoses& at, const Ray& beam,
                                const ShotSettings& settings) noexcept;

}  // namespace narpa
