#include "estimator/pnp/pnp_refine.h"

#include <Eigen/LU>
#include <cassert>

#include "estimator/pnp/pnp_points.h"

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
    assert(points.size() >= 3);
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

namespace {

struct PoseInformation {
    Matrix6 information = Matrix6::Zero();
    Vector6 by_focal = Vector6::Zero();  ///< J' C^-1 times the pixels' derivative by the focal length
};

Result<PoseInformation> pose_information(const PnpInput& input, const Rigid3& T_camera_body) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return Error{to_text(status)};
    const auto axis = input.camera->project({0, 0, 1});
    PoseInformation sum;
    for (std::size_t i = 0; i < input.body_m.size(); ++i) {
        const auto pixel = input.camera->project(T_camera_body * input.body_m[i]);
        if (!pixel) return Error{to_text(PnpStatus::behind_camera)};
        Eigen::Matrix2d C = Eigen::Matrix2d::Identity() * (input.sigma_px * input.sigma_px);
        if (!input.covariance_px2.empty()) {
            const PixelCovariance& s = input.covariance_px2[i];
            C << s.uu, s.uv, s.uv, s.vv;
        }
        const Matrix26 J = reprojection_jacobian(*input.camera, T_camera_body, input.body_m[i]);
        const Eigen::Matrix<double, 6, 2> weighted = J.transpose() * C.inverse();
        sum.information += weighted * J;
        if (axis) sum.by_focal += weighted * Eigen::Vector2d(pixel->x - axis->x, pixel->y - axis->y);
    }
    return sum;
}

}  // namespace

Result<Matrix6> pnp_bound(const PnpInput& input, const Rigid3& T_camera_body) {
    const auto sum = pose_information(input, T_camera_body);
    if (!sum) return sum.error();
    Matrix6 bound;
    if (!invert_information(sum->information, bound)) return Error{to_text(PnpStatus::degenerate)};
    return bound;
}

Vector6 shift_by_focal(const PnpInput& input, const Rigid3& T_camera_body) {
    const auto sum = pose_information(input, T_camera_body);
    Matrix6 bound;
    if (!sum || !invert_information(sum->information, bound)) return Vector6::Zero();
    return bound * sum->by_focal;
}

}  // namespace narpa
