/// estimator/dense/nuisance_fit.h - what residuals say about an error of the model that is not told.
#pragma once

#include <span>
#include <vector>

#include "estimator/dense/photometric_fit.h"

namespace narpa {

/// Change of each pixel of the prediction, DN above black, by a nuisance: one image for each of its unknowns.
using NuisanceColumns = std::vector<std::vector<float>>;

/// One more step of the fit in which the nuisance is unknown beside pose, gain and offset.
///
/// The statistic is Wald's (Trans. Am. Math. Soc. 54, 1943) with a covariance from the residuals of this fit
/// themselves (H. White, Econometrica 48, 1980; HC3 of J. G. MacKinnon, H. White, J. Econometrics 29, 1985), so
/// that it does not depend on an assumed size of the noise, only on its independence between pixels.
struct NuisanceFit {
    int unknowns = 0;  ///< of the nuisance, without those that pose and exposure explain completely
    /// About a normal number if the model has no such error.
    double sigmas = 0;
    /// Change of the pose if the nuisance is solved.
    Vector6 shift = Vector6::Zero();
    /// Covariance that the nuisance adds to the pose if it is unknown: with the prior below (zero without one), and
    /// from the residuals alone.
    Matrix6 covariance = Matrix6::Zero(), covariance_without_prior = Matrix6::Zero();
    /// Rotation of the pose for a unit of the nuisance, if it is not solved, rad.
    double rotation_response = 0;
    /// The whole step with the nuisance: its amounts, in units of the columns, pose and exposure.
    std::vector<double> amounts{};
    Vector6 pose_step = Vector6::Zero();
    Exposure exposure_step{0, 0};
};

/// `prior`: standard deviation of each unknown for NuisanceFit::covariance, in the units of its column.
/// `overconfidence`: DenseEstimate.
[[nodiscard]] NuisanceFit fit_nuisance(const PhotometricImages& images, const Exposure& exposure,
                                       const Robustness& robust, const NuisanceColumns& columns, double prior,
                                       double overconfidence);

}  // namespace narpa
