#include "estimator/batch/batch_problem.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

/// A frame or sweep whose whitened score is this many times as long as expected is taken to be wrong as a whole:
/// Cauchy's loss.
constexpr double kWrong = 5;

}  // namespace

BatchProblem::BatchProblem(const BatchInput& input, const BatchOptions& options, const BatchValues& prior_sigma)
    : options_(options),
      shared_(prior_sigma),
      are_states_when_measured_(!options.path && (input.frames.empty() || input.sweeps.empty())),
      observations_(observations_of(input, are_states_when_measured_)),
      nodes_(nodes_of(observations_)),
      scores_(observations_.size()),
      states_(nodes_.size()),
      values_(shared_.size(), 0.0) {
    for (std::size_t k = 0; k < nodes_.size(); ++k) pack(nodes_[k].state, states_[k].data());
}

void BatchProblem::add_measurement(std::size_t i, bool associates, bool has_loss) {
    BatchObservation& o = observations_[i];
    Score& score = scores_[i];
    score = {};
    const Rigid3 T = sensor_view(state(o.node), o.place, values()).T_sensor_target;
    if (associates) o.measurement->associate(T, values());
    Residuals residuals;
    if (!o.measurement->evaluate(T, values(), residuals)) return;
    score = score_of(*o.measurement, residuals, estimated_columns(*o.measurement, shared_),
                     o.measure == BatchMeasure::sweep ? options_.sweep_variance : options_.frame_variance);
    if (score.whitening.rows() == 0) return;
    const double wrong = kWrong * std::sqrt(static_cast<double>(score.whitening.rows()));
    problem_->AddResidualBlock(measurement_cost(*o.measurement, score, o.place, shared_).release(),
                               has_loss ? new ceres::CauchyLoss(wrong) : nullptr, blocks_of(o.node));
}

std::vector<double*> BatchProblem::blocks_of(std::size_t node) {
    std::vector<double*> blocks{states_[node].data()};
    if (shared_.size() > 0) blocks.push_back(values_.data());
    return blocks;
}

Status BatchProblem::linearise(bool associates, bool has_loss) {
    problem_ = std::make_unique<ceres::Problem>();
    for (auto& block : states_)
        problem_->AddParameterBlock(block.data(), kStateSize, make_state_manifold(options_.has_motion).release());
    if (shared_.size() > 0) {
        problem_->AddParameterBlock(values_.data(), static_cast<int>(shared_.size()));
        problem_->AddResidualBlock(prior_cost(shared_.size()).release(), nullptr, values_.data());
    }
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
        if (options_.path && nodes_[k].time->T_chaser_target)
            problem_->AddResidualBlock(path_cost(*nodes_[k].time, *options_.path, shared_).release(), nullptr,
                                       blocks_of(k));
        if (k == 0 || !options_.has_motion) continue;
        const double dt_s = 1e-9 * static_cast<double>(nodes_[k].time->t_ns - nodes_[k - 1].time->t_ns);
        problem_->AddResidualBlock(motion_cost(options_.motion, dt_s, state(k - 1)).release(), nullptr,
                                   states_[k - 1].data(), states_[k].data());
    }
    std::size_t used = 0;
    for (std::size_t i = 0; i < observations_.size(); ++i) {
        add_measurement(i, associates, has_loss);
        used += scores_[i].whitening.rows() > 0 && observations_[i].measurement->has_pose();
    }
    if (rms_start_.empty())
        for (const Score& s : scores_) rms_start_.push_back(s.rms);
    if (used < fewest_times(options_))
        return Error{"too few frames and sweeps see the target at the poses of the start"};
    return Ok{};
}

Result<BatchProblem::Solved> BatchProblem::solve() {
    const std::vector<double> before = values_;
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    options.max_num_iterations = 30;
    options.function_tolerance = 1e-10;
    options.parameter_tolerance = 1e-12;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem_.get(), &summary);
    if (!summary.IsSolutionUsable())
        return Error{"the least-squares problem of all frames and sweeps has no solution: " + summary.message, "",
                     0, 0, ErrorKind::failed};
    Solved out{summary.initial_cost,
               summary.final_cost,
               0,
               static_cast<int>(summary.iterations.size()) - 1,
               summary.num_effective_parameters,
               summary.num_residuals,
               ceres::LinearSolverTypeToString(summary.linear_solver_type_used)};
    for (std::size_t i = 0; i < values_.size(); ++i)
        out.moved = std::max(out.moved, std::abs(values_[i] - before[i]));
    return out;
}

void BatchProblem::report(BatchResult& out) const {
    out.residuals.resize(observations_.size());
    for (std::size_t i = 0; i < observations_.size(); ++i) {
        const BatchObservation& o = observations_[i];
        const Score& score = scores_[i];
        BatchResidual& r = out.residuals[o.index];
        r.t_ns = o.time->t_ns, r.measure = o.measure, r.rms_start = rms_start_[i];
        r.downweighted = score.downweighted, r.score_numbers = static_cast<int>(score.whitening.rows());
        Residuals residuals;
        const Rigid3 T = sensor_view(state(o.node), o.place, values()).T_sensor_target;
        if (r.score_numbers == 0 || !o.measurement->evaluate(T, values(), residuals)) continue;
        const auto groups = static_cast<double>(residuals.value.size() / o.measurement->dimension());
        r.points = static_cast<std::size_t>(groups);
        r.rms = std::sqrt(residuals.value.squaredNorm() / groups);
        r.score = (score.whitening * residuals.value).squaredNorm();
        out.jacobian_nonzeros += static_cast<std::size_t>(r.score_numbers) *
                                 (estimated_errors(options_.has_motion).size() + shared_.size());
    }
    if (nodes_.size() > 1 && options_.has_motion) out.jacobian_nonzeros += (nodes_.size() - 1) * 12 * 24;
    out.jacobian_nonzeros += shared_.size() * shared_.size();
}

}  // namespace narpa
