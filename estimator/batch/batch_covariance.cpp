#include "estimator/batch/batch_covariance.h"

#include <ceres/covariance.h>

#include <Eigen/Dense>
#include <cmath>

namespace narpa {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The run determines an unknown, or a combination, if it at least halves the variance of the prior.
constexpr double kUndeterminedVariance = 0.5;

/// `C`: covariance in standard deviations of the priors.
void add_unknowns(const SharedBlock& shared, const double* values, const Eigen::MatrixXd& C, BatchResult& out) {
    const auto n = static_cast<Eigen::Index>(shared.size());
    Eigen::VectorXd sigmas(n);
    for (Eigen::Index i = 0; i < n; ++i) {
        const auto k = static_cast<std::size_t>(i);
        sigmas[i] = shared.sigma(k);
        out.unknowns.push_back({shared.unknowns()[k], sigmas[i] * values[k], sigmas[i] * std::sqrt(C(i, i)),
                                sigmas[i], C(i, i) < kUndeterminedVariance});
    }
    out.covariance = sigmas.asDiagonal() * C * sigmas.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(C);
    for (Eigen::Index i = n - 1; i >= 0 && eigen.eigenvalues()[i] >= kUndeterminedVariance; --i) {
        const Eigen::VectorXd v = eigen.eigenvectors().col(i);
        out.undetermined.push_back({{v.begin(), v.end()}, std::sqrt(eigen.eigenvalues()[i])});
    }
}

/// The state in metres. `C`: of the state's error, in units of the model, and of the scale.
BatchState state_of(const BatchNode& node, const RelativeState& state, double scale,
                    const Eigen::Matrix<double, 13, 13>& C) {
    SensorPlace chaser;
    chaser.q_frame_chaser = node.time->q_frame_chaser;
    RelativeState metric = state;
    metric.position_m = (1 + scale) * state.position_m, metric.velocity_m_s = (1 + scale) * state.velocity_m_s;
    Eigen::Matrix<double, 12, 13> J = Eigen::Matrix<double, 12, 13>::Identity();
    J.topLeftCorner<6, 6>() *= 1 + scale;
    J.block<3, 1>(0, 12) = to_eigen(state.position_m), J.block<3, 1>(3, 12) = to_eigen(state.velocity_m_s);
    const Matrix12 covariance = J * C * J.transpose();
    const SensorView view = sensor_view(metric, chaser, {});
    const Matrix6 pose = view.by_state * covariance * view.by_state.transpose();
    return {node.time->t_ns, metric, covariance, view.T_sensor_target, pose};
}

/// Covariance of a state's error and of the scale, which has none if it is known.
Eigen::Matrix<double, 13, 13> with_scale(const ceres::Covariance& covariance, const BatchProblem& problem,
                                         std::size_t node) {
    Eigen::Matrix<double, 13, 13> out = Eigen::Matrix<double, 13, 13>::Zero();
    const auto errors = estimated_errors(problem.options().has_motion);
    const auto k = static_cast<Eigen::Index>(errors.size());
    RowMajor C(k, k);
    covariance.GetCovarianceBlockInTangentSpace(problem.state_block(node), problem.state_block(node), C.data());
    out(errors, errors) = C;
    const int place = problem.shared().place(BatchUnknown::scale);
    if (place < 0) return out;
    const double sigma = problem.shared().sigma(static_cast<std::size_t>(place));
    const auto n = static_cast<Eigen::Index>(problem.shared().size());
    RowMajor across(k, n), of_shared(n, n);
    covariance.GetCovarianceBlockInTangentSpace(problem.state_block(node), problem.shared_block(), across.data());
    covariance.GetCovarianceBlock(problem.shared_block(), problem.shared_block(), of_shared.data());
    const Eigen::VectorXd by_scale = sigma * across.col(place);
    out(errors, 12) = by_scale, out(12, errors) = by_scale.transpose();
    out(12, 12) = sigma * sigma * of_shared(place, place);
    return out;
}

}  // namespace

Status add_covariance(BatchProblem& problem, BatchResult& out) {
    ceres::Covariance::Options options;
    options.algorithm_type = ceres::SPARSE_QR;
    ceres::Covariance covariance(options);
    std::vector<std::pair<const double*, const double*>> wanted;
    const bool has_shared = problem.shared().size() > 0;
    if (has_shared) wanted.emplace_back(problem.shared_block(), problem.shared_block());
    for (std::size_t k = 0; k < problem.nodes(); ++k) {
        wanted.emplace_back(problem.state_block(k), problem.state_block(k));
        if (has_shared) wanted.emplace_back(problem.state_block(k), problem.shared_block());
    }
    if (!covariance.Compute(wanted, &problem.ceres_problem()))
        return Error{"the covariance of the batch is singular: a motion of the target is determined by nothing", "",
                     0, 0, ErrorKind::failed};
    if (has_shared) {
        const auto n = static_cast<Eigen::Index>(problem.shared().size());
        RowMajor C(n, n);
        covariance.GetCovarianceBlock(problem.shared_block(), problem.shared_block(), C.data());
        add_unknowns(problem.shared(), problem.shared_block(), C, out);
    }
    const double scale = at(problem.shared().values(problem.shared_block()), BatchUnknown::scale);
    for (std::size_t k = 0; k < problem.nodes(); ++k)
        out.states.push_back(
            state_of(problem.node(k), problem.state(k), scale, with_scale(covariance, problem, k)));
    return Ok{};
}

}  // namespace narpa
