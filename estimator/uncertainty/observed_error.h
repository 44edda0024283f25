/// estimator/uncertainty/observed_error.h - the error of a pose along the motions that its measurement observes.
///
/// An unobserved motion of finite length is a screw: a body of revolution turns about its axis. Poses that it leads
/// to cannot be told apart by the measurement, though their difference, as a vector, has parts along other motions
/// too, of second order in the length.
#pragma once

#include "estimator/uncertainty/answer.h"

namespace narpa {

/// Of the poses to which the unobserved motions lead from T, the nearest to `to`: in metres at the points' radius
/// (Observability::motions).
[[nodiscard]] Rigid3 nearest_equivalent(const Rigid3& T, const Observability& observability, const Rigid3& to);

/// Squared error in units of its covariance: chi-square with `freedom` degrees of freedom if that is right.
struct ObservedError {
    double squared = 0;  ///< infinite where the covariance is not positive definite
    int freedom = 6;
};
/// Of an estimate with this covariance and answer. If that is unobservable: of the equivalent pose nearest to the
/// truth.
[[nodiscard]] ObservedError observed_error(const Rigid3& estimate, const Matrix6& covariance, const Answer& answer,
                                           const Rigid3& truth);

}  // namespace narpa
