/// estimator/uncertainty/answer.h - classifies an estimated pose: one test for the answers of all estimators.
///
/// Each estimator states how its fit went (Fit); judge() decides, in this order:
///
/// - refused: it did not converge, its residuals are larger than noise and model explain, or no motion is observed
/// - ambiguous: another pose explains the measurement nearly as well, and the measurement cannot tell them apart
/// - unobservable: the pose is right in the observed motions, but not all motions are observed
/// - good: the pose is right within its covariance
///
/// Filters take good answers and, by their root information, unobservable ones (root_information.h).
#pragma once

#include <string>
#include <vector>

#include "estimator/uncertainty/observability.h"
#include "protocols/estimate.h"

namespace narpa {

/// Another pose that explains the measurement; its chi-square exceeds the answer's by `worse_chi2`.
struct Rival {
    Rigid3 T_sensor_target{};
    double worse_chi2 = 0;
};

/// A rival is another pose, not the same minimum, if its squared Mahalanobis distance exceeds this: ten sigma.
inline constexpr double kDistinctPose_chi2 = 100;
/// A rival cannot be excluded if its chi-square exceeds the answer's by less than this: four sigma.
inline constexpr double kRival_chi2 = 16;

/// The largest error of a guess, in attitude and as a part of the range. An answer whose distance from its guess
/// exceeds this by more than two of its own standard deviations is another minimum, a symmetric pose, or another
/// target.
struct GuessError {
    double rotation_rad = 1, part_of_range = 0.5;
};

struct Fit {
    std::string failed;               ///< why there is no pose; empty: there is one
    Vector6 moved = Vector6::Zero();  ///< from the guess, if there was one
    GuessError guess_error{};         ///< used if all motions are observed, else the default
    double range_m = 0;
    Matrix6 covariance = Matrix6::Zero();
    /// RMS residual over that which the stated noise explains, and its largest accepted value.
    double residual = 0, residual_max = 1;
    Observability observability{};
    Matrix6 root_information = Matrix6::Zero();  ///< rows of zeros for motions that are not observed
    std::vector<Rival> rivals;                   ///< other poses that are as likely
};

struct Answer {
    AnswerKind kind = AnswerKind::refused;
    std::string why = "not estimated";  ///< a sentence; empty where the answer is good
    Observability observability{};      ///< its first `unobserved` motions are unknown
    Matrix6 root_information = Matrix6::Zero();
    std::vector<Rival> rivals;

    /// True if the pose is right in the observed motions.
    [[nodiscard]] bool usable() const noexcept {
        return kind == AnswerKind::good || kind == AnswerKind::unobservable;
    }
};

[[nodiscard]] Answer judge(Fit fit);

/// Standard deviations beyond which a motion counts as unobserved by an image, as the image is not linear in the
/// pose over more. Translation is a part of the range.
inline constexpr double kMaxRotation_rad = 0.025, kMaxTranslation = 0.025;
/// Observability of a pose with this covariance: motions whose standard deviation exceeds the limits are
/// unobserved.
[[nodiscard]] Observability observability_of(const Matrix6& covariance, double range_m);
/// Sets the fields that follow from the covariance, and those on the distance from the guess.
void observe(const Rigid3& T_sensor_target, const Matrix6& covariance, Fit& fit);
void compare_with_guess(const Rigid3& T_sensor_target, const Rigid3& guess, Fit& fit);

}  // namespace narpa
