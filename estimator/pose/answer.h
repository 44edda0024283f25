/// estimator/pose/answer.h - what an estimated pose is worth: one test for the answers of all estimators.
///
/// Each estimator states how its fit went (Fit); judge() decides, in this order:
///
/// - refused: it did not converge, its residuals are larger than noise and model explain, or it holds no motion
/// - ambiguous: another pose explains the measurement nearly as well; which one is right it cannot tell
/// - unobservable: the pose is right in some motions, and the measurement does not hold the others
/// - good: the pose is right within its covariance
///
/// Filters take good answers and, by their root information, unobservable ones (root_information.h).
#pragma once

#include <string>
#include <vector>

#include "estimator/pose/observability.h"
#include "protocols/estimate.h"

namespace narpa {

/// Another pose that explains the measurement: its cost is so much above the answer's, in chi-square.
struct Rival {
    Rigid3 T_sensor_target{};
    double worse_chi2 = 0;
};

/// A rival is another pose, not the same minimum again, where it lies so many variances away: ten sigma.
inline constexpr double kElsewhere = 100;
/// It cannot be excluded where its chi-square is at most so much above the answer's: four sigma.
inline constexpr double kAsLikely = 16;

/// The largest error of a guess, in attitude and as a part of the range. An answer that is further from its guess,
/// by more than two standard deviations of its own, is another minimum, a symmetry of the target, or another
/// target.
struct GuessError {
    double rotation_rad = 1, part_of_range = 0.5;
};

struct Fit {
    std::string failed;               ///< why there is no pose; empty: there is one
    Vector6 moved = Vector6::Zero();  ///< from the guess, if there was one
    GuessError guess_error{};         ///< counts where all motions are observed, else the default
    double range_m = 0;
    Matrix6 covariance = Matrix6::Zero();
    /// Size of the residuals over that which the stated noise explains, and the largest that is accepted.
    double residual = 0, residual_most = 1;
    Observability observability{};
    Matrix6 root_information = Matrix6::Zero();  ///< rows of zeros for motions that are not observed
    std::vector<Rival> rivals;                   ///< as likely, elsewhere
};

struct Answer {
    AnswerKind kind = AnswerKind::refused;
    std::string why = "not estimated";  ///< a sentence; empty where the answer is good
    Observability observability{};      ///< its first `unobserved` motions are those that are not known
    Matrix6 root_information = Matrix6::Zero();
    std::vector<Rival> rivals;

    /// The pose is right in the motions that are observed.
    [[nodiscard]] bool usable() const noexcept {
        return kind == AnswerKind::good || kind == AnswerKind::unobservable;
    }
};

[[nodiscard]] Answer judge(Fit fit);

/// Standard deviations beyond which a motion counts as unobserved by an image: the image is not linear in the pose
/// over so much. Translation is a part of the range.
inline constexpr double kMostRotation_rad = 0.025, kMostTranslation = 0.025;
/// Of a pose with this covariance: motions whose standard deviation exceeds the limits are not observed.
[[nodiscard]] Observability observability_of(const Matrix6& covariance, double range_m);
/// Fills in what the covariance holds, and how far the pose is from its guess.
void observe(const Rigid3& T_sensor_target, const Matrix6& covariance, Fit& fit);
void compare_with_guess(const Rigid3& T_sensor_target, const Rigid3& guess, Fit& fit);

}  // namespace narpa
