#include "estimator/uncertainty/untold.h"

#include <fmt/format.h>

#include <cmath>

namespace narpa {

double as_normal(double chi2, double unknowns) {
    const double part = 2 / (9 * unknowns);
    return (std::cbrt(chi2 / unknowns) - 1 + part) / std::sqrt(part);
}

bool refuses(double sigmas, const Vector6& shift, const Matrix6& covariance) {
    const double moved_chi2 = normalised_error_squared(shift, covariance);
    return moved_chi2 >= kUntoldShift_chi2 &&
           sigmas > (moved_chi2 > kUntoldFar_chi2 ? kUntoldFar_sigmas : kUntold_sigmas);
}

std::string why_untold(std::string_view sentence, double sigmas, const Vector6& shift, const Matrix6& covariance) {
    return fmt::format(
        "{} (the residuals show it by {:.3g} standard deviations, and the pose may be off by {:.3g})", sentence,
        sigmas, std::sqrt(normalised_error_squared(shift, covariance)));
}

}  // namespace narpa
