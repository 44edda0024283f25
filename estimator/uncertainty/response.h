/// estimator/uncertainty/response.h - covariances of poses whose measurements respond to motions differently from
/// the Jacobian.
///
/// A pose with J' W r = 0 responds to a motion by R = (J' W J)^-1 J' W D, where D is the true change of the
/// measurements by the motion; R is the identity if D = J. The pose's errors are R^-1 times those predicted by the
/// Jacobian, whose covariance is C (an M-estimator's covariance: P. J. Huber, "The behavior of maximum likelihood
/// estimates under nonstandard conditions", 5th Berkeley Symposium, 1967).
#pragma once

#include "estimator/least_squares/symmetric.h"
#include "estimator/pose/pose_estimate.h"
#include "estimator/uncertainty/observability.h"

namespace narpa {

/// Lower limit of the response to a motion: so small that its variance exceeds all limits.
inline constexpr double kResponseMin = 1e-4;

/// Number of motions whose response is measured: the least observed ones, along which the changes of the
/// measurements cancel, so that errors of the Jacobian matter. The response to the others is taken as one.
inline constexpr int kMeasuredMotions = 3;

/// Returns R. `o`: observability_of the covariance C. `shown(i, motion)`: the change of the pose that the
/// measurements show when the pose changes by `motion`, one standard deviation along the i-th motion.
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

/// R^-1 C R^-T. Responses are limited to kResponseMin .. response_max: with 1, C is never reduced. Nor is it
/// reduced if some response is below one half, as the Jacobian then is wrong for other motions too. `response`: R,
/// for errors of pose_estimate.h.
[[nodiscard]] Matrix6 covariance_by_response(const Matrix6& covariance, const Matrix6& response,
                                             double response_max = 1);

}  // namespace narpa
