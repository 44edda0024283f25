/// estimator/cloud/empty_beams.h - what the beams that brought no return say of a pose.
///
/// A beam that passes through the model where a surface certainly has a return speaks against the pose. A LiDAR
/// also loses returns by chance, and the estimator does not know how many: those lie anywhere among the others,
/// while a pose that is wrong has whole stretches of empty beams where its model has surfaces and the target has
/// none. So the beams that meet the model well inside of its outline, with return and without, are put in order
/// along the scan, and the stretches of empty ones are counted. That so many empty beams fall into so few stretches
/// by chance has a probability that does not depend on how many are lost (W. Stevens, "Distribution of groups in a
/// sequence of alternatives", Annals of Eugenics 9, 1939).
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

/// Of the beams that meet the model well inside.
struct EmptyBeamCount {
    std::size_t empty = 0, returned = 0;
    std::size_t stretches = 0;  ///< of empty ones
    double chance = 1;          ///< of so few stretches or fewer

    /// By chance in one of 10,000 poses that are right.
    [[nodiscard]] bool refutes() const noexcept { return chance < 1e-4; }
};

/// Of `empty` beams among `returned` ones in so many stretches or fewer, all orders being equally likely.
[[nodiscard]] double chance_of_stretches(std::size_t empty, std::size_t returned, std::size_t stretches);

class EmptyBeams {
public:
    /// `tracer` outlives it. Only the body `target` is traced.
    EmptyBeams(const Tracer& tracer, std::size_t target, const RangeNoise& noise, const CertainReturn& certain)
        : tracer_(tracer),
          at_rest_(tracer.scene().bodies.size()),
          target_(static_cast<std::uint32_t>(target)),
          noise_(noise),
          certain_(certain) {}

    /// Sets the sweep; the spans outlive its use. Allocates only for more beams than ever before.
    void take(std::span<const RangePoint> points, std::span<const EmptyBeam> empty, const ApparentMotion& motion);

    /// At this pose at the time of the sweep. Well inside: everywhere within five standard deviations of the pose's
    /// error, of pointing, and the beam's own width the model has a return that is certain, at most 70 degrees off
    /// the surface's normal.
    [[nodiscard]] EmptyBeamCount count(const Rigid3& T_lidar_target, const Matrix6& covariance);

private:
    struct At;  ///< a pose
    template <class Beam>
    void find_inside(const At& at, std::span<const Beam> beams, bool empty);
    [[nodiscard]] std::uint32_t certain(const RayBatch& rays, Lanes<double>& range_m) const noexcept;
    [[nodiscard]] std::uint32_t well_inside(const At& at, const RayBatch& rays) const noexcept;

    const Tracer& tracer_;
    BodyPoses at_rest_;
    std::uint32_t target_;
    RangeNoise noise_;
    CertainReturn certain_;
    ApparentMotion motion_{};
    std::span<const RangePoint> points_;
    std::span<const EmptyBeam> empty_;
    std::vector<std::pair<float, bool>> inside_;  ///< place in the scan; whether it is empty
};

}  // namespace narpa
