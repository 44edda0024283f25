/// estimator/batch/batch_problem.h - the batch problem as Ceres solves it.
#pragma once

#include <ceres/problem.h>

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "estimator/batch/batch_costs.h"
#include "estimator/batch/batch_nodes.h"

namespace narpa {

class BatchProblem {
public:
    /// The arguments outlive it. `prior_sigma`: of the unknowns in use.
    BatchProblem(const BatchInput& input, const BatchOptions& options, const BatchValues& prior_sigma);

    [[nodiscard]] const BatchOptions& options() const noexcept { return options_; }
    [[nodiscard]] std::size_t nodes() const noexcept { return nodes_.size(); }
    [[nodiscard]] const BatchNode& node(std::size_t k) const noexcept { return nodes_[k]; }
    /// In units of the model (sensor_geometry.h).
    [[nodiscard]] RelativeState state(std::size_t k) const { return unpack(states_[k].data()); }
    /// States are those at the true times of the measurements, not at their stamps: of one sensor on a path of
    /// which nothing is known. Were they shifted by the clock, velocities would take up noise of the positions by
    /// it, and the clock moved by 8 standard deviations of its prior.
    [[nodiscard]] bool are_states_when_measured() const noexcept { return are_states_when_measured_; }
    [[nodiscard]] const double* state_block(std::size_t k) const noexcept { return states_[k].data(); }
    [[nodiscard]] const SharedBlock& shared() const noexcept { return shared_; }
    [[nodiscard]] const double* shared_block() const noexcept { return values_.data(); }
    [[nodiscard]] ceres::Problem& ceres_problem() noexcept { return *problem_; }

    /// Builds the problem about the present solution. `associates`: LiDAR points with the model too;
    /// `has_loss`: frames and sweeps that are wrong as a whole lose their weight.
    [[nodiscard]] Status linearise(bool associates, bool has_loss);
    struct Solved {
        double cost_start = 0, cost = 0;
        double moved = 0;  ///< largest change of an unknown, in standard deviations of its prior
        int iterations = 0, parameters = 0, numbers = 0;
        std::string solver;
    };
    [[nodiscard]] Result<Solved> solve();
    /// Sets the residuals of frames and sweeps, and the size of the problem.
    void report(BatchResult& out) const;

private:
    [[nodiscard]] BatchValues values() const { return shared_.values(values_.data()); }
    void add_measurement(std::size_t i, bool associates, bool has_loss);
    /// Parameter blocks of a residual of one state.
    [[nodiscard]] std::vector<double*> blocks_of(std::size_t node);

    const BatchOptions& options_;
    SharedBlock shared_;
    bool are_states_when_measured_;
    std::vector<BatchObservation> observations_;
    std::vector<BatchNode> nodes_;
    std::vector<Score> scores_;      ///< of each observation
    std::vector<double> rms_start_;  ///< of the residuals, with the model as it was given
    std::vector<std::array<double, kStateSize>> states_;
    std::vector<double> values_;  ///< the shared block
    std::unique_ptr<ceres::Problem> problem_;
};

}  // namespace narpa
