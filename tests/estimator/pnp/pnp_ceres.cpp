#include "tests/estimator/pnp/pnp_ceres.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/sized_cost_function.h>
#include <ceres/solver.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <memory>

#include "estimator/pnp/pnp_points.h"

namespace narpa {
namespace {

/// Upper triangular W with W' W = C^-1.
Eigen::Matrix2d whitening(const PnpInput& input, std::size_t i) {
    if (input.covariance_px2.empty()) return Eigen::Matrix2d::Identity() / input.sigma_px;
    const PixelCovariance& s = input.covariance_px2[i];
    Eigen::Matrix2d information;
    const double determinant = s.uu * s.vv - s.uv * s.uv;
    information << s.vv / determinant, -s.uv / determinant, -s.uv / determinant, s.uu / determinant;
    return Eigen::LLT<Eigen::Matrix2d>(information).matrixU();
}

/// d exp(r) p = left_jacobian(r) dr x exp(r) p: the left Jacobian of SO(3).
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& r) {
    const double angle = r.norm(), square = angle * angle;
    const bool small = angle < 1e-4;
    const double a = small ? 0.5 - square / 24 : (1 - std::cos(angle)) / square;
    const double b = small ? 1.0 / 6 - square / 120 : (angle - std::sin(angle)) / (angle * square);
    return Eigen::Matrix3d::Identity() + a * skew(r) + b * skew(r) * skew(r);
}

/// Whitened residual of one point. The parameters: a rotation vector from the start's attitude, and the
/// translation.
struct Residual {
    const PnpInput& input;
    Quat start;
    std::size_t i;
    Eigen::Matrix2d W = whitening(input, i);

    /// False where the point has no image. `jacobian` may be null.
    bool evaluate(const double* x, Eigen::Vector2d& residual, Matrix26* jacobian) const {
        const Rigid3 T{exp_rotation({x[0], x[1], x[2]}) * start, {x[3], x[4], x[5]}};
        const auto image = input.camera->project(T * input.body_m[i]);
        if (!image) return false;
        residual = W * Eigen::Vector2d(image->x - input.pixels[i].u, image->y - input.pixels[i].v);
        if (jacobian == nullptr) return true;
        *jacobian = W * reprojection_jacobian(*input.camera, T, input.body_m[i]);
        jacobian->leftCols<3>() *= left_jacobian({x[0], x[1], x[2]});
        return true;
    }
};

class ResidualOfPoint final : public ceres::SizedCostFunction<2, 6> {
public:
    ResidualOfPoint(const PnpInput& input, const Quat& start, std::size_t i) : residual_{input, start, i} {}

    bool Evaluate(double const* const* x, double* residuals, double** jacobians) const override {
        Eigen::Vector2d residual;
        Matrix26 J;
        const bool wanted = jacobians != nullptr && jacobians[0] != nullptr;
        if (!residual_.evaluate(x[0], residual, wanted ? &J : nullptr)) return false;
        std::copy_n(residual.data(), 2, residuals);
        if (wanted) Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>>(jacobians[0], 2, 6) = J;
        return true;
    }

private:
    Residual residual_;
};

std::unique_ptr<ceres::LossFunction> loss_function(const RobustLoss& loss) {
    return loss.kind == Loss::none ? nullptr : std::make_unique<ceres::CauchyLoss>(loss.scale);
}

/// The pose with chi2, covariance and status as pnp_refine.h has them.
PnpFit evaluated(const PnpInput& input, const Rigid3& T, const RobustLoss& loss, bool converged) {
    PnpPoints points(input.body_m.size());
    points.assign(input);
    const CentredPose pose = points.centred(T);
    PnpFit fit;
    fit.T_camera_body = T;
    fit.degrees_of_freedom = 2 * static_cast<int>(input.body_m.size()) - 6;
    if (!points.evaluate(pose, loss, fit.summary.equations)) {
        fit.status = PnpStatus::behind_camera;
        return fit;
    }
    fit.chi2 = fit.summary.equations.chi2;
    Matrix6 covariance;
    if (!invert_information(fit.summary.equations.A, covariance)) {
        fit.status = PnpStatus::degenerate;
        return fit;
    }
    fit.covariance = points.uncentred(pose, covariance);
    fit.status = converged ? PnpStatus::converged : PnpStatus::no_convergence;
    return fit;
}

PnpFit failure(PnpStatus status) {
    PnpFit fit;
    fit.status = status;
    return fit;
}

Rigid3 pose_of(const Quat& start, const double* x) {
    return {normalized(exp_rotation({x[0], x[1], x[2]}) * start), {x[3], x[4], x[5]}};
}

}  // namespace

PnpFit refine_with_ceres(const PnpInput& input, const Rigid3& start, const RobustLoss& loss) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return failure(status);
    if (!is_usable(start)) return failure(PnpStatus::not_finite);
    const Quat q0 = normalized(start.q);
    for (const Vec3& p : input.body_m)
        if (!input.camera->project(q0 * p + start.t)) return failure(PnpStatus::behind_camera);
    double x[6] = {0, 0, 0, start.t.x, start.t.y, start.t.z};
    const std::unique_ptr<ceres::LossFunction> loss_of_all = loss_function(loss);
    ceres::Problem::Options ours;
    ours.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(ours);
    for (std::size_t i = 0; i < input.body_m.size(); ++i)
        problem.AddResidualBlock(new ResidualOfPoint(input, q0, i), loss_of_all.get(), x);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 100;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (summary.termination_type == ceres::FAILURE) return failure(PnpStatus::behind_camera);
    PnpFit fit = evaluated(input, pose_of(q0, x), loss, summary.termination_type == ceres::CONVERGENCE);
    fit.summary.iterations = static_cast<int>(summary.iterations.size()) - 1;
    for (std::size_t i = 0; i < summary.iterations.size(); ++i)
        fit.summary.chi2_at[i] = 2 * summary.iterations[i].cost;
    return fit;
}

}  // namespace narpa
