#include "estimator/pose/pnp_refine.h"

#include <Eigen/LU>

#include "estimator/pose/pnp_points.h"

namespace narpa {
namespace {

struct Problem {
    const PnpPoints& points;
    const RobustLoss& loss;

    bool evaluate(const CentredPose& pose, NormalEquations& eq) const { return points.evaluate(pose, loss, eq); }

    static CentredPose moved(const CentredPose& pose, const Vector6& h) {
        // Half the small rotation is the increment's Rodrigues vector: no sine, and exactly the rotation's axis.
        return {normalized(Quat{1, 0.5 * h[0], 0.5 * h[1], 0.5 * h[2]} * pose.q),
                pose.centroid_m + Vec3{h[3], h[4], h[5]}};
    }
};

}  // namespace

bool is_usable(const Rigid3& T) {
    const double n = dot(T.q, T.q);
    return std::isfinite(n) && n > 0 && is_finite(T.t);
}

void refine(const PnpPoints& points, const Rigid3& start, const RefineOptions& options, PnpFit& fit) {
    fit.T_camera_body = start;
    fit.covariance.setZero();
    fit.chi2 = 0;
    fit.degrees_of_freedom = 2 * static_cast<int>(points.size()) - 6;
    fit.summary.iterations = 0;
    if (!is_usable(start)) {
        fit.status = PnpStatus::not_finite;
        return;
    }
    CentredPose pose = points.centred({normalized(start.q), start.t});
    levenberg_marquardt(Problem{points, options.loss}, pose, options.lm, fit.summary);
    if (fit.summary.status == LmStatus::no_start) {
        fit.status = PnpStatus::behind_camera;
        return;
    }
    fit.T_camera_body = points.uncentred(pose);
    fit.chi2 = fit.summary.equations.chi2;
    Matrix6 covariance;
    if (!invert_information(fit.summary.equations.A, covariance)) {
        fit.status = PnpStatus::degenerate;
        return;
    }
    fit.covariance = points.uncentred(pose, covariance);
    fit.status = fit.summary.status == LmStatus::converged ? PnpStatus::converged : PnpStatus::no_convergence;
}

const PnpFit& PnpRefiner::refine(const PnpInput& input, const Rigid3& start, const RefineOptions& options) {
    fit_.status = check(input);
    if (fit_.ok() && input.body_m.size() > points_.capacity()) fit_.status = PnpStatus::too_many_points;
    if (!fit_.ok()) return fit_;
    points_.assign(input);
    narpa::refine(points_, start, options, fit_);
    return fit_;
}

Result<Matrix6> pnp_bound(const PnpInput& input, const Rigid3& T_camera_body) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return Error{in_words(status)};
    Matrix6 F = Matrix6::Zero();
    for (std::size_t i = 0; i < input.body_m.size(); ++i) {
        if (!input.camera->project(T_camera_body * input.body_m[i]))
            return Error{in_words(PnpStatus::behind_camera)};
        Eigen::Matrix2d C = Eigen::Matrix2d::Identity() * (input.sigma_px * input.sigma_px);
        if (!input.covariance_px2.empty()) {
            const PixelCovariance& s = input.covariance_px2[i];
            C << s.uu, s.uv, s.uv, s.vv;
        }
        const Matrix26 J = reprojection_jacobian(*input.camera, T_camera_body, input.body_m[i]);
        F += J.transpose() * C.inverse() * J;
    }
    Matrix6 bound;
    if (!invert_information(F, bound)) return Error{in_words(PnpStatus::degenerate)};
    return bound;
}

}  // namespace narpa
