/// estimator/batch/batch_costs.h - the residuals of the batch problem for Ceres.
///
/// A state is a parameter block of kStateSize numbers: position, velocity, attitude (w, x, y, z), rate. Its
/// manifold is that of RelativeState's errors, or of those of position and attitude alone. Cost functions give
/// derivatives by the error in the first twelve columns and 0 in the last, for which the manifold's own derivative
/// is [1; 0], or the columns of it that vary.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "estimator/batch/batch_solver.h"
#include "estimator/batch/score.h"
#include "estimator/batch/sensor_geometry.h"

namespace narpa {

inline constexpr int kStateSize = 13;

void pack(const RelativeState& state, double* block);
[[nodiscard]] RelativeState unpack(const double* block);
/// Of the errors of a state that are estimated: the tangent space of its block, in their order.
[[nodiscard]] std::span<const int> estimated_errors(bool has_motion);
[[nodiscard]] std::unique_ptr<ceres::Manifold> make_state_manifold(bool has_motion);

/// The unknowns that are estimated, as one parameter block in units of their priors' standard deviations.
class SharedBlock {
public:
    explicit SharedBlock(const BatchValues& prior_sigma);

    [[nodiscard]] const std::vector<BatchUnknown>& unknowns() const noexcept { return unknowns_; }
    [[nodiscard]] std::size_t size() const noexcept { return unknowns_.size(); }
    /// Place of an unknown in the block; -1: known.
    [[nodiscard]] int place(BatchUnknown u) const noexcept { return places_[static_cast<std::size_t>(u)]; }
    [[nodiscard]] double sigma(std::size_t place) const noexcept { return sigmas_[place]; }
    [[nodiscard]] BatchValues values(const double* block) const;

private:
    std::vector<BatchUnknown> unknowns_;
    std::vector<double> sigmas_;
    std::array<int, kBatchUnknowns> places_{};
};

/// Columns of a measurement's Jacobian that are estimated: the pose's, and those of its unknowns in `shared`.
[[nodiscard]] std::vector<Eigen::Index> estimated_columns(const Measurement& measurement,
                                                          const SharedBlock& shared);

/// Parameter blocks: the state, and the shared block if it has any. The arguments outlive the cost.
[[nodiscard]] std::unique_ptr<ceres::CostFunction> measurement_cost(const Measurement& measurement,
                                                                    const Score& score, const SensorPlace& place,
                                                                    const SharedBlock& shared);
/// Blocks: the states before and after dt_s > 0. `from`: the first state, about which the noise is computed.
[[nodiscard]] std::unique_ptr<ceres::CostFunction> motion_cost(const MotionModel& model, double dt_s,
                                                               const RelativeState& from);
/// Blocks as of a measurement. The pose relative to a chaser of this attitude is the given one to within `sigma`.
[[nodiscard]] std::unique_ptr<ceres::CostFunction> path_cost(const BatchTime& time, const PathSigma& sigma,
                                                             const SharedBlock& shared);
/// Block: the shared one.
[[nodiscard]] std::unique_ptr<ceres::CostFunction> prior_cost(std::size_t unknowns);

}  // namespace narpa
