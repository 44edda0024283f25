/// estimator/uncertainty/unobserved.h - the guess along motions that a measurement does not observe.
///
/// Along these an iteration drifts wherever noise leads it. The answer therefore keeps the guess there (J. Zhang,
/// M. Kaess, S. Singh, "On degeneracy of optimization-based state estimation problems", ICRA 2016), with the
/// guess's uncertainty.
#pragma once

#include "estimator/uncertainty/answer.h"

namespace narpa {

/// The part of `motion` along the unobserved motions.
[[nodiscard]] Vector6 unobserved_part(const Observability& o, const Vector6& motion);

/// The step x that solves information x = gradient without moving along the unobserved motions.
[[nodiscard]] Vector6 observed_step(const Observability& o, const Matrix6& information, const Vector6& gradient);

/// The covariance with that of the guess along the unobserved motions.
[[nodiscard]] Matrix6 with_guess(const Observability& o, const Matrix6& covariance, const GuessError& guess,
                                 double range_m);

}  // namespace narpa
