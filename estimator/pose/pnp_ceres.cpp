#include "estimator/pose/pnp_ceres.h"

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <ceres/tiny_solver.h>
#include <ceres/tiny_solver_autodiff_function.h>

#include <Eigen/Cholesky>
#include <memory>

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

template <class T>
void whitened_residual(const PnpInput& input, std::size_t i, const Eigen::Matrix2d& W, const T* b, T* residual) {
    const T u = input.camera.fx * b[0] / b[2] + input.camera.cx - input.pixels[i].u;
    const T v = input.camera.fy * b[1] / b[2] + input.camera.cy - input.pixels[i].v;
    residual[0] = W(0, 0) * u + W(0, 1) * v;
    residual[1] = W(1, 1) * v;
}

/// Of one point.
struct Residual {
    const PnpInput& input;
    std::size_t i;
    Eigen::Matrix2d W = whitening(input, i);

    template <class T>
    bool operator()(const T* q_wxyz, const T* t, T* residual) const {
        const Vec3& p = input.body_m[i];
        const T a[3] = {T(p.x), T(p.y), T(p.z)};
        T b[3];
        ceres::UnitQuaternionRotatePoint(q_wxyz, a, b);
        for (int k = 0; k < 3; ++k) b[k] += t[k];
        if (b[2] <= T(0)) return false;
        whitened_residual(input, i, W, b, residual);
        return true;
    }
};

/// Of all points, by a rotation vector from the start and a translation.
struct AllResiduals {
    using Scalar = double;
    enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 6 };

    const PnpInput& input;
    const Rigid3& start;
    std::vector<Eigen::Matrix2d> W{};

    [[nodiscard]] int NumResiduals() const { return 2 * static_cast<int>(input.body_m.size()); }

    template <class T>
    bool operator()(const T* x, T* residuals) const {
        for (std::size_t i = 0; i < input.body_m.size(); ++i) {
            const Vec3 turned = start.q * input.body_m[i];
            const T a[3] = {T(turned.x), T(turned.y), T(turned.z)};
            T b[3];
            ceres::AngleAxisRotatePoint(x, a, b);
            for (int k = 0; k < 3; ++k) b[k] += x[3 + k];
            if (b[2] <= T(0)) return false;
            whitened_residual(input, i, W[i], b, residuals + 2 * i);
        }
        return true;
    }
};

std::unique_ptr<ceres::LossFunction> loss_function(const RobustLoss& loss) {
    switch (loss.kind) {
        case Loss::none: return nullptr;
        case Loss::huber: return std::make_unique<ceres::HuberLoss>(loss.scale);
        case Loss::cauchy: return std::make_unique<ceres::CauchyLoss>(loss.scale);
        case Loss::tukey: return std::make_unique<ceres::TukeyLoss>(loss.scale);
    }
    return nullptr;
}

/// The pose with chi2, covariance and status as pnp_refine.h has them.
PnpFit judged(const PnpInput& input, const Rigid3& T, const RobustLoss& loss, bool converged) {
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

PnpFit refused(PnpStatus status) {
    PnpFit fit;
    fit.status = status;
    return fit;
}

bool is_usable(const Rigid3& T) {
    const double n = dot(T.q, T.q);
    return std::isfinite(n) && n > 0 && is_finite(T.t);
}

}  // namespace

PnpFit refine_with_ceres(const PnpInput& input, const Rigid3& start, const RobustLoss& loss) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return refused(status);
    if (!is_usable(start)) return refused(PnpStatus::not_finite);
    const Quat q0 = normalized(start.q);
    for (const Vec3& p : input.body_m)
        if (!((q0 * p + start.t).z > 0)) return refused(PnpStatus::behind_camera);
    double q[4] = {q0.w, q0.x, q0.y, q0.z}, t[3] = {start.t.x, start.t.y, start.t.z};
    const std::unique_ptr<ceres::LossFunction> loss_of_all = loss_function(loss);
    ceres::Problem::Options ours;
    ours.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ceres::Problem problem(ours);
    problem.AddParameterBlock(q, 4, new ceres::QuaternionManifold);
    problem.AddParameterBlock(t, 3);
    for (std::size_t i = 0; i < input.body_m.size(); ++i)
        problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Residual, 2, 4, 3>(new Residual{input, i}),
                                 loss_of_all.get(), q, t);
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.num_threads = 1;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 100;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (summary.termination_type == ceres::FAILURE) return refused(PnpStatus::behind_camera);
    PnpFit fit = judged(input, {normalized(Quat{q[0], q[1], q[2], q[3]}), {t[0], t[1], t[2]}}, loss,
                        summary.termination_type == ceres::CONVERGENCE);
    fit.summary.iterations = static_cast<int>(summary.iterations.size()) - 1;
    for (std::size_t i = 0; i < summary.iterations.size(); ++i)
        fit.summary.chi2_at[i] = 2 * summary.iterations[i].cost;
    return fit;
}

PnpFit refine_with_tiny_solver(const PnpInput& input, const Rigid3& start) {
    if (const PnpStatus status = check(input); status != PnpStatus::converged) return refused(status);
    if (!is_usable(start)) return refused(PnpStatus::not_finite);
    const Rigid3 from{normalized(start.q), start.t};
    AllResiduals residuals{input, from};
    for (std::size_t i = 0; i < input.body_m.size(); ++i) residuals.W.push_back(whitening(input, i));
    using Function = ceres::TinySolverAutoDiffFunction<AllResiduals, Eigen::Dynamic, 6>;
    const Function function(residuals);
    ceres::TinySolver<Function> solver;
    Vector6 x;
    x << 0, 0, 0, to_eigen(from.t);
    const auto summary = solver.Solve(function, &x);
    const Quat q = exp_rotation({x[0], x[1], x[2]}) * from.q;
    using Status = std::decay_t<decltype(summary.status)>;
    PnpFit fit =
        judged(input, {normalized(q), {x[3], x[4], x[5]}}, {}, summary.status != Status::HIT_MAX_ITERATIONS);
    fit.summary.iterations = summary.iterations;
    return fit;
}

}  // namespace narpa
