#include "estimator/uncertainty/answer.h"

#include <fmt/format.h>
#include <cassert>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// Standard deviations by which an observed pose may be further from the guess than the guess's largest error.
constexpr double kBeyondGuess_sigmas = 2;

/// Scale factors from motions in units of the limits to (rotation rad, translation m).
Vector6 limits(double range_m) {
    Vector6 most;
    most << Eigen::Vector3d::Constant(kMaxRotation_rad), Eigen::Vector3d::Constant(kMaxTranslation * range_m);
    return most;
}

/// The standard deviation along a shift.
double sigma_along(const Eigen::Vector3d& shift, const Eigen::Matrix3d& covariance) {
    const Eigen::Vector3d direction = shift.stableNormalized();
    return std::sqrt(std::max(0.0, direction.dot(covariance * direction)));
}

/// Largest accepted distance from the guess, rad and m.
std::array<double, 2> farthest(const Fit& fit) {
    const bool observed = fit.observability.unobserved == 0;
    const GuessError most = observed ? fit.guess_error : GuessError{};
    const double sigmas = observed ? kBeyondGuess_sigmas : 0;
    return {most.rotation_rad + sigmas * sigma_along(fit.moved.head<3>(), fit.covariance.topLeftCorner<3, 3>()),
            most.part_of_range * fit.range_m +
                sigmas * sigma_along(fit.moved.tail<3>(), fit.covariance.bottomRightCorner<3, 3>())};
}

std::string to_text(const Observability& o) {
    return fmt::format("{} of six motions not observed", o.unobserved);
}

}  // namespace

Answer judge(Fit fit) {
    assert(fit.observability.unobserved >= 0 && fit.observability.unobserved <= 6);
    Answer answer;
    answer.observability = fit.observability;
    answer.root_information = fit.root_information;
    answer.rivals = std::move(fit.rivals);
    answer.why.clear();
    const double turn = fit.moved.head<3>().norm(), shift = fit.moved.tail<3>().norm();
    const auto [max_turn, max_shift] = farthest(fit);
    if (!fit.failed.empty()) {
        answer.why = std::move(fit.failed);
    } else if (!(fit.residual <= fit.residual_max)) {
        answer.why = fmt::format("residuals are {:.3g} times what noise explains, expected at most {:.3g}",
                                 fit.residual, fit.residual_max);
    } else if (turn > max_turn || shift > max_shift) {
        answer.why = fmt::format("{:.3g} deg and {:.3g} m from the guess, expected at most {:.3g} deg and {:.3g} m",
                                 turn / kDegree, shift, max_turn / kDegree, max_shift);
    } else if (fit.observability.unobserved == 6 || !fit.root_information.allFinite()) {
        answer.why = "no motion of the target is observed";
    } else if (!answer.rivals.empty()) {
        answer.kind = AnswerKind::ambiguous;
        answer.why = "another pose is nearly as likely";
    } else if (fit.observability.unobserved > 0) {
        answer.kind = AnswerKind::unobservable;
        answer.why = to_text(fit.observability);
    } else {
        answer.kind = AnswerKind::good;
    }
    return answer;
}

Observability observability_of(const Matrix6& covariance, double range_m) {
    assert(range_m >= 0);
    const Vector6 most = limits(range_m);
    const Matrix6 scaled = most.cwiseInverse().asDiagonal() * covariance * most.cwiseInverse().asDiagonal();
    // Eigenvalues are ascending: the least information first is the largest variance first.
    const SymmetricEigen eigen = symmetric_eigen(0.5 * (scaled + scaled.transpose()));
    Observability o;
    o.eigenvalues = eigen.values.reverse().cwiseInverse();
    o.motions = most.asDiagonal() * eigen.vectors.rowwise().reverse();
    while (o.unobserved < 6 && !(o.eigenvalues[o.unobserved] >= 1)) ++o.unobserved;
    return o;
}

void observe(const Rigid3& T, const Matrix6& covariance, Fit& fit) {
    fit.observability = observability_of(covariance, norm(T.t));
    fit.root_information = fit.observability.root_information(inverse(covariance), 1);
    fit.covariance = covariance;
}

void compare_with_guess(const Rigid3& T, const Rigid3& guess, Fit& fit) {
    fit.moved = error_between(guess, T);
    fit.range_m = norm(guess.t);
}

}  // namespace narpa
