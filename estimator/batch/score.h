/// estimator/batch/score.h - a measurement compressed to the score of its unknowns, with the covariance of that.
///
/// Errors of a frame's points overlap, so the inverse of their information is not the covariance of an estimate.
/// The score g = sum w J' S^-1 r, whose zero is the robust estimate of the frame alone, has a covariance G that is
/// known from the errors' overlap. Its whitened value G^-1/2 g has one number per unknown, unit covariance, and
/// derivative G^-1/2 H: as residuals of a least-squares problem they give each frame the weight and the problem the
/// covariance of the sandwich estimator H^-1 G H^-1 (Huber 1967; Liang and Zeger 1986).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/batch/measurement.h"

namespace narpa {

struct Score {
    /// Whitened score = whitening * residuals: as many rows as the measurement determines unknowns.
    Eigen::MatrixXd whitening;
    double scatter = 0;       ///< of the residuals beyond the sensor's noise (Measurement::beyond)
    double freedom = 0;       ///< degrees of freedom of the residuals
    double rms = 0;           ///< of the residuals, in pixels or metres
    double downweighted = 0;  ///< part of the groups with less than a quarter of the full weight: outliers
};

/// Scatter and weights are those of the residuals about the measurement's own pose. They have Student's t
/// distribution with five degrees of freedom, whose scale, by `scatter`, is estimated from them (K. Lange, R.
/// Little, J. Taylor, "Robust statistical modeling using the t distribution", JASA 84, 1989). `columns`: of the
/// Jacobian, the unknowns that are estimated. `unknowns_per_frame`: degrees of freedom that the measurement alone
/// uses up. `variance_factor`: on G, for errors that measurements have in common. Empty whitening: too few
/// residuals.
[[nodiscard]] Score score_of(const Measurement& measurement, const Residuals& residuals,
                             const std::vector<Eigen::Index>& columns, double variance_factor);

}  // namespace narpa
