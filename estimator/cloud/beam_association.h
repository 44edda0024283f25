/// estimator/cloud/beam_association.h - correspondences of a sweep's beams with the model at a pose.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

enum class BeamFate : std::uint8_t {
    met,      ///< the model's surface lies on the beam
    missed,   ///< the beam misses the model
    edge,     ///< a surface ends within its footprint (RangeNoise::footprint_rad)
    grazing,  ///< it meets the surface at too flat an angle for its range to be used
};

/// A point and the tangent plane that it should lie on, target coordinates.
struct PointToPlane {
    BeamFate fate = BeamFate::missed;
    Vec3 surface_m{}, normal{};  ///< where the model was met; unit, towards the LiDAR
    double distance_m = 0;       ///< of the measured point from the plane, along the normal
    double sigma_m = 1;          ///< its standard deviation
};

/// Number `k` of twelve rays about a beam: six around the rim of a cone of this tangent, or just outside it, and
/// six halfway to it.
inline constexpr int kConeRays = 12;
[[nodiscard]] Ray ray_in_cone(const Ray& beam, double tangent, int k) noexcept;

/// Sorts beams so that those of like elevation and azimuth lie together: a spinning LiDAR's lasers fire by turns at
/// elevations that are far apart.
[[nodiscard]] float place_of(const Vec3& direction) noexcept;

class BeamAssociation {
public:
    /// `tracer` outlives it. Only the body `target` is traced.
    BeamAssociation(const Tracer& tracer, std::size_t target);

    /// Sets the sweep. Allocates only for more points than ever before.
    void take(std::span<const RangePoint> points, const ApparentMotion& motion);
    [[nodiscard]] std::size_t size() const noexcept { return beams_.size(); }
    /// The shortest range of the sweep.
    [[nodiscard]] double nearest_m() const noexcept { return nearest_m_; }
    /// Of the target about its origin.
    [[nodiscard]] double reach_m() const noexcept { return tracer_.bounding_radius_m(target_); }

    /// The target is so many times as large as its model, from now on.
    void set_scale(double scale) noexcept { scale_ = scale; }

    /// For every `stride`-th point from the first, in order, at this pose at the time of the sweep. With `search_m`
    /// > 0, for poses that are far off, sixteen rays within that distance of the beam are traced and the hit
    /// nearest to the point is used; a point whose beam misses is then attracted by the surface and its edges. Its
    /// sigma_m is a quarter of `search_m` combined with the noise, so that all points within reach weigh alike.
    void associate(const Rigid3& T_lidar_target, const RangeNoise& noise, double search_m, std::size_t stride,
                   std::vector<PointToPlane>& out) const;

    /// Finds the points in whose footprint a surface ends at this pose; they are of BeamFate::edge until the next
    /// call. Without a footprint there are none.
    void find_edges(const Rigid3& T_lidar_target, const RangeNoise& noise);

    /// The point may as well lie on another surface that ends next to its beam: one that rays within `radius_m` of
    /// it meet, turned by more than 30 degrees, and within three standard deviations of the point. `p`: of
    /// associate() for point `i`.
    [[nodiscard]] bool may_lie_elsewhere(const Rigid3& T_lidar_target, const RangeNoise& noise, double radius_m,
                                         std::size_t i, const PointToPlane& p) const;

    /// The derivative of distance_m with an error of the pose (pose_estimate.h), for point `i` of the sweep.
    [[nodiscard]] Vector6 derivative(const Rigid3& T_lidar_target, std::size_t i, const PointToPlane& p) const;

    /// The derivative of distance_m with the range, for the same point.
    [[nodiscard]] double along_beam(const Rigid3& T_lidar_target, std::size_t i, const PointToPlane& p) const {
        return dot(p.normal, in_model(T_lidar_target, beams_[i]).direction);
    }

private:
    /// A beam relative to a target at rest: compensated for the target's motion since the time of the pose.
    struct Beam {
        Quat turn{};               ///< of the target since then, LiDAR axes
        Vec3 origin_m, direction;  ///< turned back
        double range_m = 0;
        bool edge = false;  ///< find_edges
    };
    /// In coordinates of the model, as long as the target's over the scale.
    [[nodiscard]] Ray in_model(const Rigid3& T_lidar_target, const Beam& beam) const noexcept;
    void along_beams(const Rigid3& T, std::size_t stride, std::vector<PointToPlane>& out) const;
    [[nodiscard]] std::uint32_t meeting_edges(const RayBatch& axes, const HitBatch& met,
                                              const RangeNoise& noise) const;
    void around_beams(const Rigid3& T, double search_m, std::size_t stride, std::vector<PointToPlane>& out) const;
    /// Sixteen rays within `radius_m` of the beam at the point, the first through it. Returns the point; both in
    /// coordinates of the model.
    Vec3 trace_around(const Rigid3& T, const Beam& beam, double radius_m, HitBatch& hits) const;

    const Tracer& tracer_;
    BodyPoses at_rest_;  ///< model coordinates are the tracer's world
    std::uint32_t target_;
    bool turning_ = false;
    double scale_ = 1, nearest_m_ = 0;
    std::vector<Beam> beams_;
    std::vector<std::pair<float, std::uint32_t>> order_;  ///< points, by neighbourhood
};

}  // namespace narpa
