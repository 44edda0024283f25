/// estimator/cloud/empty_beams.h - tests a pose by the beams that brought no return.
///
/// A beam without return that passes through the model where a surface certainly has a return is evidence against
/// the pose. A LiDAR also loses returns by chance, at a rate unknown to the estimator. Lost returns are scattered
/// at random among the others, while a wrong pose makes whole stretches of empty beams, where the model has
/// surfaces and the target has none. So the beams that meet the model well inside its outline, with and without
/// return, are ordered along the scan, and the stretches of empty ones are counted. The probability that so many
/// empty beams fall into so few stretches by chance does not depend on the loss rate (W. Stevens, "Distribution of
/// groups in a sequence of alternatives", Annals of Eugenics 9, 1939).
#pragma once

#include <span>
#include <utility>
#include <vector>

#include "estimator/cloud/range_points.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

/// Counts over the beams that meet the model well inside its outline.
struct EmptyBeamCount {
    std::size_t empty = 0, returned = 0;
    std::size_t stretches = 0;  ///< runs of consecutive empty beams
    double chance = 1;          ///< probability of so few stretches or fewer

    /// A correct pose is refuted by chance in one of 10,000 cases.
    [[nodiscard]] bool refutes() const noexcept { return chance < 1e-4; }
};

/// Probability that `empty` beams among `returned` ones form so many stretches or fewer, all orders being equally
/// likely.
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

    /// Sets the sweep; the spans outlive its use. Allocates only when it has more beams than all sweeps before.
    void take(std::span<const RangePoint> points, std::span<const EmptyBeam> empty, const ApparentMotion& motion);

    /// At this pose at the time of the sweep. A beam is well inside the outline if the model has a certain return,
    /// at most 70 degrees off the surface's normal, everywhere within the beam's own width plus five standard
    /// deviations of the pose's error and of pointing.
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
    std::vector<std::pair<float, bool>> inside_;  ///< sort key of place_of; whether the beam is empty
};

}  // namespace narpa
