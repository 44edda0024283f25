/// estimator/uncertainty/observability.h - which motions of a target are observable from its surface points.
///
/// Rotations of a sphere are not observable, nor are translations along a plane. N. Gelfand,
/// L. Ikemoto, S. Rusinkiewicz, M. Levoy, "Geometrically stable sampling for the ICP algorithm", 3DIM 2003: the
/// eigenvectors of the point-to-plane Hessian about the points' centre, their distances scaled to one, are such
/// motions where the eigenvalue is near zero. J. Zhang, M. Kaess, S. Singh, "On degeneracy of optimization-based
/// state estimation problems", ICRA 2016: the solution is not changed along these.
#pragma once

#include <optional>

#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// Distribution of the points that a Hessian was summed over.
struct PointSpread {
    double weight = 0;    ///< sum of their weights
    Vec3 centre_m{};      ///< weighted mean, from the target's origin, in sensor axes
    double radius_m = 0;  ///< root of the weighted mean square of the distance from the centre
};

/// Motions are errors as in pose_estimate.h: (rotation rad, translation m).
struct Observability {
    /// Eigenvalues of the Hessian for a total weight of one and a radius of one, ascending: a cube has 2/15 three
    /// times, for its rotations, and 1/3 three times.
    Vector6 eigenvalues = Vector6::Zero();
    /// Columns: the eigenvectors. Each moves points at the radius by about a metre: |rotation|^2 radius^2 +
    /// |translation of the centre|^2 = 1 m^2.
    Matrix6 motions = Matrix6::Zero();
    int unobserved = 0;  ///< number of leading motions whose eigenvalue is below the threshold

    /// The motion x that solves H x = gradient within the observable subspace. `hessian`: that passed to
    /// observability().
    [[nodiscard]] Vector6 solve(const Matrix6& hessian, const Vector6& gradient) const;
    /// The information matrix in coordinates along the motions; unit matrix for the unobserved ones.
    [[nodiscard]] Matrix6 along_motions(const Matrix6& information) const;
    /// `factor` times the inverse of this information in the observable subspace. Along unobservable motions it is
    /// that of the guess; without one the standard deviation is kUnobservedSigma.
    [[nodiscard]] Matrix6 covariance(const Matrix6& information, double factor,
                                     const std::optional<Matrix6>& of_guess = {}) const;
    /// Root of the inverse of that covariance without the unobserved motions (root_information.h): a row of zeros
    /// for each of these.
    [[nodiscard]] Matrix6 root_information(const Matrix6& information, double factor) const;
};

/// Standard deviation along an unobserved motion if nothing is known of it, m.
inline constexpr double kUnobservedSigma = 1e4;

/// `hessian`: the sum of weight * J J', J the derivative of a point's distance from its plane with the motion.
[[nodiscard]] Observability observability(const Matrix6& hessian, const PointSpread& spread, double threshold);

}  // namespace narpa
