/// estimator/cloud/observability.h - which motions of a target its surface points can tell, and which they cannot.
///
/// Points on a sphere do not tell how it turns, points on a plane do not tell where on it they lie. N. Gelfand,
/// L. Ikemoto, S. Rusinkiewicz, M. Levoy, "Geometrically stable sampling for the ICP algorithm", 3DIM 2003: the
/// eigenvectors of the point-to-plane Hessian about the points' centre, their distances scaled to one, are such
/// motions where the eigenvalue is near zero. J. Zhang, M. Kaess, S. Singh, "On degeneracy of optimization-based
/// state estimation problems", ICRA 2016: the solution is left as it was along these.
#pragma once

#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// Where the points lie that a Hessian was summed over.
struct PointSpread {
    double weight = 0;    ///< sum of their weights
    Vec3 centre_m{};      ///< weighted mean, from the target's origin, in sensor axes
    double radius_m = 0;  ///< root of the weighted mean square of the distance from the centre
};

/// Motions are errors as pose_estimate.h has them: (rotation rad, translation m).
struct Observability {
    /// Ascending, of the Hessian for a weight of one and a radius of one: a cube has 2/15 three times, for its
    /// rotations, and 1/3 three times.
    Vector6 eigenvalues = Vector6::Zero();
    /// Columns: the motions that belong to them, which do not disturb one another. Each moves points at the radius
    /// by about a metre: |rotation|^2 radius^2 + |translation of the centre|^2 = 1 m^2.
    Matrix6 motions = Matrix6::Zero();
    int unobserved = 0;  ///< so many of them, from the first, are below the threshold

    /// The motion x that solves H x = gradient, without any part along what is not observed. `hessian`: that of
    /// which this was made.
    [[nodiscard]] Vector6 solve(const Matrix6& hessian, const Vector6& gradient) const;
    /// The covariance of what is observed: `factor` times the inverse of this information. Along the unobserved
    /// motions the standard deviation is put at kUnobservedSigma: they are not known at all.
    [[nodiscard]] Matrix6 covariance(const Matrix6& information, double factor) const;
};

/// Times the motions' metre: enough for whoever weighs the estimate to take nothing from it.
inline constexpr double kUnobservedSigma = 1e4;

/// `hessian`: the sum of weight * J J', J the derivative of a point's distance from its plane with the motion.
[[nodiscard]] Observability observability(const Matrix6& hessian, const PointSpread& spread, double threshold);

}  // namespace narpa
