/// estimator/pnp/pnp_refine.h - least-squares pose from correspondences and a nearby pose, without allocation.
///
/// Levenberg-Marquardt (levenberg_marquardt.h) on the reprojection error. The attitude is a quaternion; classical
/// Rodrigues parameters are the increment of one step, set to zero after it, so that no attitude is special (a
/// global CRP vector fails near half a turn). Derivatives are analytic and go straight into the 6 x 6 normal
/// equations.
#pragma once

#include "base/result.h"
#include "estimator/pnp/pnp_points.h"

namespace narpa {

struct RefineOptions {
    LmOptions lm;
    RobustLoss loss;
};

struct PnpFit {
    PnpStatus status = PnpStatus::no_convergence;
    Rigid3 T_camera_body{};
    /// Covariance of T_camera_body (pose_estimate.h), (rad, m): the inverse of the information at the given pixel
    /// noise, with the robust weights if a loss is used.
    Matrix6 covariance = Matrix6::Zero();
    double chi2 = 0;             ///< sum of squared residuals in units of their noise, or the robust cost
    int degrees_of_freedom = 0;  ///< 2 N - 6: expected chi2 if the noise is as given and no loss is used
    LmSummary summary;

    [[nodiscard]] bool ok() const noexcept { return status == PnpStatus::converged; }
    /// Predicted standard deviation of the position (all three axes), as a part of the range.
    [[nodiscard]] double relative_position_sigma() const {
        return std::sqrt(covariance.bottomRightCorner<3, 3>().trace()) / norm(T_camera_body.t);
    }
};

/// True if a start can be refined: finite, with a rotation.
bool is_usable(const Rigid3& T);

/// Refines from `start`; `fit` is filled in place. `points` holds what was assigned to it. Every point stays in
/// front of the camera.
void refine(const PnpPoints& points, const Rigid3& start, const RefineOptions& options, PnpFit& fit);

/// Has room for points_max points, for loops that may not allocate.
class PnpRefiner {
public:
    explicit PnpRefiner(std::size_t points_max) : points_(points_max) {}

    /// Checks the input and refines from `start`. The fit stays valid until the next call.
    const PnpFit& refine(const PnpInput& input, const Rigid3& start, const RefineOptions& options = {});

private:
    PnpPoints points_;
    PnpFit fit_;
};

/// The Cramer-Rao bound of a pose seen through these points: the inverse of F = sum J' C^-1 J with
/// J = dpi/db [-[R a]x | I], a covariance as in pose_estimate.h. Of `input` the pixels are not read. Errors: what
/// check() finds, a point behind the camera, or a direction that the points leave undetermined.
[[nodiscard]] Result<Matrix6> pnp_bound(const PnpInput& input, const Rigid3& T_camera_body);

/// Shift of a least-squares pose, as an error (pose_estimate.h), per relative change of the focal length. Points at
/// different depths also make it rotate. Zero where pnp_bound fails.
[[nodiscard]] Vector6 shift_by_focal(const PnpInput& input, const Rigid3& T_camera_body);

}  // namespace narpa
