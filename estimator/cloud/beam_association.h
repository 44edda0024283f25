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

enum class BeamClass : std::uint8_t {
    met,      ///< the model's surface lies on the beam
    missed,   ///< the beam misses the model
    edge,     ///< a surface ends within its footprint (RangeNoise::footprint_rad)
    grazing,  ///< it meets the surface at too flat an angle for its range to be used
};

/// A point and the tangent plane on which it should lie, target coordinates.
struct PointToPlane {
    BeamClass fate = BeamClass::missed;
    Vec3 surface_m{}, normal{};  ///< hit on the model; unit normal, towards the LiDAR
    double distance_m = 0;       ///< signed distance of the measured point from the plane, along the normal
    double sigma_m = 1;          ///< standard deviation of distance_m
};

/// Ray `k` of twelve about a beam: six on the rim of a cone with this tangent or just outside it, six at half of
/// its radius.
inline constexpr int kConeRays = 12;
[[nodiscard]] Ray ray_in_cone(const Ray& beam, double tangent, int k) noexcept;

/// Sort key by which beams of similar elevation and azimuth are adjacent: a spinning LiDAR fires its lasers in an
/// order that alternates between distant elevations.
[[nodiscard]] float place_of(const Vec3& direction) noexcept;

class BeamAssociation {
public:
    /// `tracer` outlives it. Only the body `target` is traced.
    BeamAssociation(const Tracer& tracer, std::size_t target);

    /// Sets the sweep. Allocates only when the sweep has more points than all before.
    void take(std::span<const RangePoint> points, const ApparentMotion& motion);
    [[nodiscard]] std::size_t size() const noexcept { return beams_.size(); }
    /// The shortest range of the sweep.
    [[nodiscard]] double nearest_m() const noexcept { return nearest_m_; }
    /// Bounding radius of the target about its origin.
    [[nodiscard]] double reach_m() const noexcept { return tracer_.bounding_radius_m(target_); }

    /// From now on the target is this many times as large as its model.
    void set_scale(double scale) noexcept { scale_ = scale; }

    /// Associates every `stride`-th point, starting with the first, in order, at this pose at the time of the
    /// sweep. With `search_m` > 0, for poses with large errors, traces sixteen rays within that distance of the
    /// beam and uses the hit nearest to the point, so that a point whose beam misses is attracted by the surface
    /// and its edges. sigma_m is then a quarter of `search_m` combined with the range noise, so that all points in
    /// the search radius have similar weights.
    void associate(const Rigid3& T_lidar_target, const RangeNoise& noise, double search_m, std::size_t stride,
                   std::vector<PointToPlane>& out) const;

    /// Finds the points with a surface edge in their footprint at this pose; they keep BeamClass::edge until the
    /// next call. Finds none if the footprint is 0.
    void find_edges(const Rigid3& T_lidar_target, const RangeNoise& noise);

    /// True if the point may equally lie on another surface next to its beam: a ray within `radius_m` of it hits a
    /// surface that is turned by more than 30 degrees and passes within three standard deviations of the point.
    /// `p`: result of associate() for point `i`.
    [[nodiscard]] bool may_be_on_other_surface(const Rigid3& T_lidar_target, const RangeNoise& noise,
                                               double radius_m, std::size_t i, const PointToPlane& p) const;

    /// Derivative of distance_m by the error of the pose (pose_estimate.h), for point `i` of the sweep.
    [[nodiscard]] Vector6 derivative(const Rigid3& T_lidar_target, std::size_t i, const PointToPlane& p) const;

    /// Derivative of distance_m by the range, for the same point.
    [[nodiscard]] double along_beam(const Rigid3& T_lidar_target, std::size_t i, const PointToPlane& p) const {
        return dot(p.normal, in_model(T_lidar_target, beams_[i]).direction);
    }

private:
    /// A beam relative to a stationary target: compensated for the target's motion since the time of the pose.
    struct Beam {
        Quat turn{};                      ///< rotation of the target since then, LiDAR axes
        Vec3 origin_m, direction;         ///< rotated back
        double range_m = 0, sigma_m = 0;  ///< as RangePoint
        bool edge = false;                ///< set by find_edges
    };
    /// Standard deviation of the beam's range.
    [[nodiscard]] static double range_sigma_m(const Beam& beam, const RangeNoise& noise) noexcept {
        return beam.sigma_m > 0 ? beam.sigma_m : noise.range_m;
    }
    /// The beam in model coordinates, which are target coordinates divided by the scale.
    [[nodiscard]] Ray in_model(const Rigid3& T_lidar_target, const Beam& beam) const noexcept;
    void along_beams(const Rigid3& T, std::size_t stride, std::vector<PointToPlane>& out) const;
    [[nodiscard]] std::uint32_t meeting_edges(const RayBatch& axes, const HitBatch& met,
                                              const RangeNoise& noise) const;
    void around_beams(const Rigid3& T, double search_m, std::size_t stride, std::vector<PointToPlane>& out) const;
    /// Traces sixteen rays within `radius_m` of the beam at the measured point, the first through it. Returns the
    /// point, in model coordinates like the hits.
    Vec3 trace_around(const Rigid3& T, const Beam& beam, double radius_m, HitBatch& hits) const;

    const Tracer& tracer_;
    BodyPoses at_rest_;  ///< model coordinates are the tracer's world
    std::uint32_t target_;
    bool turning_ = false;
    double scale_ = 1, nearest_m_ = 0;
    std::vector<Beam> beams_;
    std::vector<std::pair<float, std::uint32_t>> order_;  ///< point indices, sorted by place_of
};

}  // namespace narpa
