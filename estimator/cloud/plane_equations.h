/// estimator/cloud/plane_equations.h - robust normal equations of a sweep's points and the model's tangent planes.
#pragma once

#include <cstddef>

#include "estimator/pose/pose_estimate.h"
#include "estimator/uncertainty/leverage.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "estimator/uncertainty/observability.h"

namespace narpa {

/// Residual of one point: its distance from the tangent plane and that distance's derivatives, in standard
/// deviations.
struct PlaneResidual {
    double distance = 0;
    Vector6 by_pose = Vector6::Zero();
    /// By one standard deviation of each error that all ranges have in common: ModelUncertainty::range_bias_m, and
    /// RangePoint::common_m.
    Eigen::RowVector3d by_common = Eigen::RowVector3d::Zero();
    double by_scale = 0;  ///< per unit of relative size: a model twice as large
    double sigma_m = 0;   ///< standard deviation of the distance
    Vec3 at_m{};          ///< hit on the model, relative to the target's origin, LiDAR axes
};

/// Sums over the points at one pose, each weighted by Tukey's biweight of its distance.
class PlaneEquations {
public:
    /// `scatter`: standard deviation of the distances, in units of the noise.
    explicit PlaneEquations(double scatter) : scatter_(scatter) {}

    /// Returns the point's weight; 0: it is left out.
    double add(const PlaneResidual& point);
    /// Call after the last point. `scale_sigma`: prior standard deviation of the model's relative size, whose
    /// present estimate is 1 + `scale`; 0: the size is known.
    void finish(double scale, double scale_sigma);

    /// Gauss-Newton step of the pose, and of the size if it has a prior (eliminated by the Schur complement).
    struct Step {
        Vector6 pose = Vector6::Zero();
        double scale = 0;
    };
    [[nodiscard]] Vector6 pose_step(const Observability& observability) const {
        return observability.solve(hessian_, gradient_);
    }
    [[nodiscard]] Step step(const Observability& observability) const;
    /// Shifts of the pose by unknowns of the model: by the ranges' common errors, and by the part of the model's
    /// size that the points leave unknown.
    [[nodiscard]] PoseShifts shifts(const Observability& observability) const;
    /// Variance of the robust estimate over that of least squares with the configured noise: Huber's formula with
    /// his correction for few points. The sandwich estimator with one term per point was tried: where few points
    /// hold a motion its sigma was too small by a factor of 1.2 on a craft of 200,000 triangles.
    [[nodiscard]] double variance_factor() const;

    [[nodiscard]] const Matrix6& hessian() const { return hessian_; }
    [[nodiscard]] const Matrix6& information() const { return information_; }
    [[nodiscard]] const PointSpread& spread() const { return spread_; }
    [[nodiscard]] double scatter() const { return scatter_; }
    [[nodiscard]] std::size_t used() const { return used_; }

private:
    double scatter_;
    std::size_t used_ = 0;
    Matrix6 hessian_ = Matrix6::Zero();      ///< sum of weight * J J' / sigma^2
    Vector6 gradient_ = Vector6::Zero();     ///< -sum of weight * J distance / sigma^2
    Matrix6 information_ = Matrix6::Zero();  ///< sum of J J' / sigma^2 of the points used
    /// Gradients by the common errors, and per unit of relative size.
    Eigen::Matrix<double, 6, 3> by_common_ = Eigen::Matrix<double, 6, 3>::Zero();
    Vector6 by_scale_ = Vector6::Zero();
    bool size_is_known_ = true;
    double scale_hessian_ = 0, scale_gradient_ = 0;  ///< of the model's size, with its prior
    double scores2_ = 0, slopes_ = 0, slopes2_ = 0;  ///< sums of psi^2, psi', psi'^2 of the points used
    PointSpread spread_;
    double moment_ = 0;
};

}  // namespace narpa
