/// renderer/lidar/diffuse_multipath.h - LiDAR multipath: light that returns by way of two surfaces.
///
/// A pulse lights a surface A, A lights B, and the receiver of a beam sees B: an echo at half the path's length,
/// (r_A + d + r_B) / 2, which is never less than B's own range r_B. The path is traced from the receiver: from B,
/// where a sub-ray ends, rays continue in directions w sampled in proportion to f_B cos_B, as far as the material
/// allows. The surface A that one hits contributes, if the pulse lights it and nothing occludes it, the light
///
///     pi * (f_B cos_B / pdf(w)) * f_A cos_A / r_A^2,
///
/// in the unit in which a diffuse surface's own echo is reflectivity * cos / r^2; the mean over the rays is the
/// integral over all A. It has no factor 1 / d^2, so that the variance does not grow in corners.
///
/// A pulse lights the LiDAR's whole field evenly where the instrument does (LidarSpec::lit), else the cone of its
/// own beam. Left out: paths by three surfaces or more, each of which multiplies the light by its albedo and the
/// share that hits the next; and paths that contain a mirror or glass, too.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "protocols/lidar/lidar_model.h"
#include "renderer/lidar/lidar_shot.h"
#include "renderer/scene/scene.h"

namespace narpa {

class DiffuseMultipath {
public:
    /// Rays that continue from the hits of a beam, for all its sub-rays together; with more sub-rays, one for each.
    static constexpr std::size_t kRays = 32;

    /// Allocates nothing for a LiDAR without LidarReceiverModel::Multipath::diffuse. `sub_rays`: of a beam. The
    /// tracer must outlive it.
    DiffuseMultipath(const Tracer& tracer, const Lidar& lidar, std::uint64_t seed, std::size_t index,
                     std::size_t sub_rays);

    [[nodiscard]] bool is_on() const noexcept { return rays_each_ > 0; }

    /// The sub-rays of a batch.
    struct SubRays {
        Lanes<std::uint64_t> shot;   ///< shot number, which determines the random draws
        Lanes<std::size_t> of_beam;  ///< which of the beam's sub-rays it is
        Lanes<std::size_t> place;    ///< index in the results
        Vec3Lanes axis;              ///< of its beam, unit, world

        void put(std::size_t i, std::uint64_t of_shot, std::size_t number, std::size_t at, const Vec3& along) {
            shot[i] = of_shot, of_beam[i] = number, place[i] = at, axis.put(i, along);
        }
    };
    /// Traces on from the hits of `rays` and stores the returns at the places of these sub-rays.
    void trace(const BodyPoses& at, const RayBatch& rays, const SubRays& sub_rays, const HitBatch& hits,
               std::span<const LidarReturn> returns, const ShotSettings& settings) noexcept;
    /// The returns of the beam whose first sub-ray is this one. Those with a range each add an equal share of their
    /// light.
    [[nodiscard]] std::span<LidarReturn> of_beam(std::size_t first_sub_ray) noexcept {
        return std::span(late_).subspan(first_sub_ray * rays_each_, sub_rays_ * rays_each_);
    }

private:
    [[nodiscard]] bool is_lit(const BodyPoses& at, double time, const Vec3& axis,
                              const Vec3& direction) const noexcept;

    const Tracer& tracer_;
    LidarField lit_{};
    int mount_;
    Quat q_mount_lidar_;
    double cos_beam_ = 1;
    std::size_t sub_rays_, rays_each_ = 0;
    std::uint64_t seed_;
    std::uint32_t stream_;
    std::vector<LidarReturn> late_;  ///< returns, sub-ray by sub-ray
};

}  // namespace narpa
