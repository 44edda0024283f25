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

/// Error of a state, then of two unknowns that all states have in common: scale and clock.
constexpr int kScaleError = 12, kClockError = 13, kErrors = 14;
using Covariance = Eigen::Matrix<double, kErrors, kErrors>;

/// The state in metres at the time of the stamp. `C`: of the state as it was estimated, in units of the model;
/// `clock_s`: the state is that so much before the stamp.
BatchState state_of(const BatchNode& node, const RelativeState& state, double scale, double clock_s,
                    const Covariance& C) {
    SensorPlace chaser;
    chaser.q_frame_chaser = node.time->q_frame_chaser;
    RelativeState metric = state;
    metric.velocity_m_s = (1 + scale) * state.velocity_m_s;
    metric.position_m = (1 + scale) * state.position_m + clock_s * metric.velocity_m_s;
    metric.q_frame_target = normalized(state.q_frame_target * exp_rotation(clock_s * state.rate_rad_s));

    Eigen::Matrix<double, 12, kErrors> J = Eigen::Matrix<double, 12, kErrors>::Identity();
    J.topLeftCorner<6, 6>() *= 1 + scale;
    J.block<3, 3>(0, 3) = (1 + scale) * clock_s * Eigen::Matrix3d::Identity();
    J.block<3, 3>(6, 9) = clock_s * Eigen::Matrix3d::Identity();
    J.block<3, 1>(0, kScaleError) = to_eigen(state.position_m + clock_s * state.velocity_m_s);
    J.block<3, 1>(3, kScaleError) = to_eigen(state.velocity_m_s);
    J.block<3, 1>(0, kClockError) = to_eigen(metric.velocity_m_s);
    J.block<3, 1>(6, kClockError) = to_eigen(state.rate_rad_s);
    const Matrix12 covariance = J * C * J.transpose();
    const SensorView view = sensor_view(metric, chaser, {});
    const Matrix6 pose = view.by_state * covariance * view.by_state.transpose();
    return {node.time->t_ns, metric, covariance, view.T_sensor_target, pose};
}

/// Of one node. What is known has none.
Covariance covariance_of(const ceres::Covariance& covariance, const BatchProblem& problem, std::size_t node) {
    Covariance out = Covariance::Zero();
    const auto errors = estimated_errors(problem.options().has_motion);
    const auto k = static_cast<Eigen::Index>(errors.size());
    RowMajor C(k, k);
    covariance.GetCovarianceBlockInTangentSpace(problem.state_block(node), problem.state_block(node), C.data());
    out(errors, errors) = C;
    const auto n = static_cast<Eigen::Index>(problem.shared().size());
    if (n == 0) return out;
    RowMajor across(k, n), of_shared(n, n);
    covariance.GetCovarianceBlockInTangentSpace(problem.state_block(node), problem.shared_block(), across.data());
    covariance.GetCovarianceBlock(problem.shared_block(), problem.shared_block(), of_shared.data());

    struct Place {
        int error, shared;
    };
    std::vector<Place> used;
    const auto use = [&](int error, BatchUnknown u) {
        if (const int place = problem.shared().place(u); place >= 0) used.push_back({error, place});
    };
    use(kScaleError, BatchUnknown::scale);
    if (problem.are_states_when_measured()) use(kClockError, BatchUnknown::clock);
    const auto sigma = [&](Place p) { return problem.shared().sigma(static_cast<std::size_t>(p.shared)); };
    for (const Place a : used) {
        out(errors, a.error) = sigma(a) * across.col(a.shared);
        out(a.error, errors) = out(errors, a.error).transpose();
        for (const Place b : used) out(a.error, b.error) = sigma(a) * sigma(b) * of_shared(a.shared, b.shared);
    }
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
    const BatchValues values = problem.shared().values(problem.shared_block());
    const double clock_s = problem.are_states_when_measured() ? at(values, BatchUnknown::clock) : 0;
    for (std::size_t k = 0; k < problem.nodes(); ++k)
        out.states.push_back(state_of(problem.node(k), problem.state(k), at(values, BatchUnknown::scale), clock_s,
                                      covariance_of(covariance, problem, k)));
    return Ok{};
}

}  // namespace narpa
