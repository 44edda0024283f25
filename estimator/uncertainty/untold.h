/// estimator/uncertainty/untold.h - when residuals that show an error of the model refuse a pose.
///
/// Each estimator fits nuisances of which no uncertainty was told beside the pose: what they explain, in standard
/// deviations, and how far they move the pose. An error that the residuals do not show, or that does not matter for
/// the pose, refuses nothing.
#pragma once

#include <string>
#include <string_view>

#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// Names the suspect where the error grows with the row.
inline constexpr std::string_view kProgressiveRows =
    "rows are shifted progressively: a rolling shutter, or another motion than assumed?";

/// Noise alone exceeds this in 3 of 10^5 tests.
inline constexpr double kUntold_sigmas = 4;
/// Squared Mahalanobis distance by which a nuisance may move the pose: half of a standard deviation.
inline constexpr double kUntoldShift_chi2 = 0.25;
/// If it moves the pose by five standard deviations, less evidence suffices: noise exceeds it in 6 of 1000 tests.
inline constexpr double kUntoldFar_chi2 = 25, kUntoldFar_sigmas = 2.5;

/// A shift of the pose by up to eight standard deviations may enlarge its covariance instead of refusing it.
/// Progressive rows move features in photographs of a chessboard by a webcam by two to seven.
inline constexpr double kWidenedShift_chi2 = 64;

/// The normal number that is as likely as this chi-square (E. B. Wilson, M. M. Hilferty, Proc. Natl. Acad. Sci. 17,
/// 1931).
[[nodiscard]] double as_normal(double chi2, double unknowns);

/// True if an error that the residuals show by `sigmas` refuses the pose. `shift`: of the pose, if it is solved
/// for.
[[nodiscard]] bool refuses(double sigmas, const Vector6& shift, const Matrix6& covariance);

/// "SENTENCE (the residuals show it by N standard deviations, and the pose may be off by M)".
[[nodiscard]] std::string why_untold(std::string_view sentence, double sigmas, const Vector6& shift,
                                     const Matrix6& covariance);

}  // namespace narpa
