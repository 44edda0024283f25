/// estimator/cloud/plane_equations.h - robust normal equations of a sweep's points and the model's tangent planes.
#pragma once

#include <cstddef>

#include "estimator/pose/leverage.h"
#include "estimator/pose/model_uncertainty.h"
#include "estimator/pose/observability.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// Of one point: its distance from the tangent plane and the distance's derivatives, in standard deviations.
struct PlaneResidual {
    double distance = 0;
    Vector6 by_pose = Vector6::Zero();
    double by_range = 0;  ///< for a metre more of range
    double by_scale = 0;  ///< for a model twice as large
    double sigma_m = 0;   ///< of the distance
    Vec3 at_m{};          ///< the point on the model, target's origin, the LiDAR's axes
};

/// Sums over the points at one pose, each weighted by Tukey's biweight of its distance.
class PlaneEquations {
public:
    /// `scatter`: of the distances, in standard deviations of the noise.
    explicit PlaneEquations(double scatter) : scatter_(scatter) {}

    /// The point's weight; 0: it is left out.
    double add(const PlaneResidual& point);
    /// After the last point. `scale_sigma`: prior of the model's size, which is now taken to be larger by the part
    /// `scale`; 0: it is known.
    void finish(double scale, double scale_sigma);

    /// Gauss-Newton step of the pose; with a prior of the size also of that (the Schur complement of the pose).
    struct Step {
        Vector6 pose = Vector6::Zero();
        double scale = 0;
    };
    [[nodiscard]] Vector6 pose_step(const Observability& observability) const {
        return observability.solve(hessian_, gradient_);
    }
    [[nodiscard]] Step step(const Observability& observability) const;
    /// Shifts of the pose by what is not known of the model: of the ranges' bias as the points weigh it, and of
    /// what they leave unknown of the model's size.
    [[nodiscard]] PoseShifts shifts(const ModelUncertainty& model, const Observability& observability) const;
    /// The variance of the robust estimate over that of least squares with the noise as it is set: Huber's, with
    /// his correction for few points. His other form, the sandwich of one term for each point, was tried: where a
    /// few points hold a motion it is too sure, by 1.2 in sigma on a craft of 200,000 triangles.
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
    Vector6 by_range_ = Vector6::Zero();     ///< the gradient for a metre more of range,
    Vector6 by_scale_ = Vector6::Zero();     ///< and for a model twice as large
    bool size_is_known_ = true;
    double scale_hessian_ = 0, scale_gradient_ = 0;  ///< of the model's size itself, with its prior
    double scores2_ = 0, slopes_ = 0, slopes2_ = 0;  ///< sums of psi^2, psi', psi'^2 of the points used
    PointSpread spread_;
    double moment_ = 0;
};

}  // namespace narpa
