/// estimator/cloud/beam_association.h - what each beam of a sweep should have met, had the target this pose.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

enum class BeamFate : std::uint8_t {
    met,      ///< the model's surface lies on the beam
    missed,   ///< the beam passes the model by
    grazing,  ///< it meets it at so flat an angle that its range says nothing
};

/// A point beside the plane that it should lie on, in target axes and about the target's origin.
struct PointToPlane {
    BeamFate fate = BeamFate::missed;
    Vec3 surface_m{}, normal{};  ///< where the model was met; unit, towards the LiDAR
    double distance_m = 0;       ///< of the measured point from the plane, along the normal
    double sigma_m = 1;          ///< its standard deviation
};

class BeamAssociation {
public:
    /// `tracer` outlives it. Only the body `target` is looked at.
    BeamAssociation(const Tracer& tracer, std::size_t target);

    /// The sweep that is asked about from now on. Allocates only for more points than ever before.
    void take(std::span<const RangePoint> points, const SweepMotion& motion);
    [[nodiscard]] std::size_t size() const noexcept { return beams_.size(); }

    /// For every `stride`-th point from the first, in order, at this pose at the time of the sweep. With
    /// `search_m` > 0, which serves where the pose is far off, sixteen rays look for the surface as far around the
    /// beam, and the place nearest to the point is taken; a point whose beam misses is drawn straight to it, edges
    /// draw too. Its sigma_m is then a quarter of `search_m` with the noise: all that is within reach counts alike.
    void associate(const Rigid3& T_lidar_target, const RangeNoise& noise, double grazing_cosine, double search_m,
                   std::size_t stride, std::vector<PointToPlane>& out) const;

    /// The derivative of distance_m with an error of the pose (pose_estimate.h), for point `i` of the sweep.
    [[nodiscard]] Vector6 derivative(const Rigid3& T_lidar_target, std::size_t i, const PointToPlane& p) const;

private:
    /// A beam as it looks from a target that rests: the target's turn since the time of the pose is taken out.
    struct Beam {
        Quat turn{};               ///< of the target since then, LiDAR axes
        Vec3 origin_m, direction;  ///< turned back
        double range_m = 0;
    };
    [[nodiscard]] Ray in_target(const Rigid3& T_lidar_target, const Beam& beam) const noexcept;
    void along_beams(const Rigid3& T, std::size_t stride, std::vector<PointToPlane>& out) const;
    void around_beams(const Rigid3& T, double search_m, std::size_t stride, std::vector<PointToPlane>& out) const;

    const Tracer& tracer_;
    BodyPoses at_rest_;  ///< target coordinates are the tracer's world
    std::uint32_t target_;
    bool turning_ = false;
    std::vector<Beam> beams_;
};

}  // namespace narpa
