/// renderer/lidar/diffuse_multipath.h - light that comes back to a LiDAR by way of two surfaces.
///
/// A pulse lights a surface A, A lights B, and the receiver of a beam sees B: light from half the path's length,
/// (r_A + d + r_B) / 2, which is never less than B's own range r_B. It is traced from the receiver: where a sub-ray
/// ends, at B, rays go on in directions w chosen in proportion to f_B cos_B, as far as the material can. What one
/// meets, A, counts where the pulse lights it and nothing stands between: it brings the light
///
///     pi * (f_B cos_B / pdf(w)) * f_A cos_A / r_A^2,
///
/// in the unit in which a diffuse surface's own echo is reflectivity * cos / r^2; the mean over the rays is the
/// integral over all A. There is no 1 / d^2 in it, so that corners are no harder than other places.
///
/// A pulse lights the LiDAR's whole field evenly where the instrument does (LidarSpec::lit), else the cone of its
/// own beam. Left out: light by way of three surfaces or more, each of which takes it times its albedo and the
/// share that meets the next; and light that goes by way of a mirror or glass too.
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
    /// Rays that go on from what a beam meets, of all its sub-rays together; more sub-rays have one each.
    static constexpr std::size_t kRays = 32;

    /// Of a LiDAR without LidarReceiverModel::Multipath::diffuse nothing is allocated. `sub_rays`: of a beam. The
    /// tracer must outlive it.
    DiffuseMultipath(const Tracer& tracer, const Lidar& lidar, std::uint64_t seed, std::size_t index,
                     std::size_t sub_rays);

    [[nodiscard]] bool is_on() const noexcept { return rays_each_ > 0; }

    /// Of a batch.
    struct SubRays {
        Lanes<std::uint64_t> shot;   ///< number, which decides on the random draws
        Lanes<std::size_t> of_beam;  ///< which of the beam's sub-rays it is
        Lanes<std::size_t> place;    ///< in the results
        Vec3Lanes axis;              ///< of its beam, unit, world

        void put(std::size_t i, std::uint64_t of_shot, std::size_t number, std::size_t at, const Vec3& along) {
            shot[i] = of_shot, of_beam[i] = number, place[i] = at, axis.put(i, along);
        }
    };
    /// Writes what comes back by way of what `rays` met, to the places of these sub-rays.
    void trace(const BodyPoses& at, const RayBatch& rays, const SubRays& sub_rays, const HitBatch& hits,
               std::span<const LidarReturn> returns, const ShotSettings& settings) noexcept;
    /// Of a beam whose first sub-ray is this one, for a sum over them all: those with a range bring their share.
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
    std::vector<LidarReturn> late_;  ///< of one sub-ray after the other
};

}  // namespace narpa
