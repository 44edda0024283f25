/// estimator/pose/response.h - covariances of poses whose measurements respond to motions otherwise than the
/// Jacobian says.
///
/// A pose where J' W r = 0 answers a motion by the response R = (J' W J)^-1 J' W D, D being what the motion really
/// changes the measurements by: the identity where J = D. The pose's errors are those that the Jacobian states, C,
/// times R^-1 (an M-estimator's covariance: P. J. Huber, "The behavior of maximum likelihood estimates under
/// nonstandard conditions", 5th Berkeley Symposium, 1967).
#pragma once

#include "estimator/pose/observability.h"
#include "estimator/pose/pose_estimate.h"
#include "estimator/pose/symmetric.h"

namespace narpa {

/// Of a motion of which nothing is shown: so little that its variance is beyond all limits.
inline constexpr double kLeastShown = 1e-4;

/// So many motions are measured, those that are held least: there the changes of the measurements cancel, so that
/// errors of the Jacobian matter. The others count as shown as they are.
inline constexpr int kMeasuredMotions = 3;

/// R. `o`: of the covariance C (observability_of). `shown(i, motion)`: the change of the pose that the measurements
/// show when the pose changes by `motion`, one standard deviation of the i-th of them.
template <class Shown>
[[nodiscard]] Matrix6 response_to_weakest(const Observability& o, Shown&& shown) {
    const Matrix6 motions = o.motions * o.eigenvalues.cwiseSqrt().cwiseInverse().asDiagonal();
    const Matrix6 in_sigmas = inverse(motions);
    Matrix6 response = Matrix6::Identity();
    for (int i = 0; i < kMeasuredMotions; ++i) {
        const Vector6 motion = motions.col(i);
        response += (shown(i, motion) - motion) * in_sigmas.row(i);
    }
    return response;
}

/// R^-1 C R^-T. Motions of which more than `most_shown` times is shown count as shown so often: with 1 nothing of C
/// is taken away, nor where a motion is shown by less than half, as the Jacobian then is wrong in others too. All
/// motions count as shown by at least kLeastShown. `response`: of errors (pose_estimate.h).
[[nodiscard]] Matrix6 covariance_by_response(const Matrix6& covariance, const Matrix6& response,
                                             double most_shown = 1);

}  // namespace narpa
