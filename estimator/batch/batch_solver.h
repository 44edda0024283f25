/// estimator/batch/batch_solver.h - all frames and sweeps of a run in one least-squares problem: the trajectory and
/// what is wrong with the model.
///
/// Unknowns: the relative state (motion_model.h) at each time of measurement, and unknowns that all measurements
/// have in common (batch_unknowns.h) with Gaussian priors. Residuals: the whitened scores of frames and sweeps
/// (score.h), the motion model between consecutive states, and the priors. Solved by Ceres with
/// SPARSE_NORMAL_CHOLESKY: consecutive states are coupled, so there is no independent set for a Schur complement to
/// eliminate, and the normal equations are block tridiagonal with a border of the common unknowns. Measurements are
/// linearised and LiDAR points associated again until neither changes the solution.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/batch/measurement.h"
#include "estimator/filter/motion_model.h"

namespace narpa {

/// Where the chaser was at the time stamp of a measurement.
struct BatchTime {
    std::int64_t t_ns = 0;
    Quat q_frame_chaser{};     ///< its attitude, exact
    Vec3 chaser_rate_rad_s{};  ///< its rate, chaser axes
    /// The commanded pose, used if BatchOptions::path is given.
    std::optional<Rigid3> T_chaser_target{};
};
struct BatchFrame {
    BatchTime time;
    Rigid3 T_camera_target{};  ///< start, by the model
    PointObservations points;
    BrightnessObservations brightness;  ///< empty: not observed
};
struct BatchSweep {
    BatchTime time;
    Rigid3 T_lidar_target{};  ///< start, by the model
    SweepObservations returns;
};

struct BatchInput {
    std::shared_ptr<const CameraModel> camera;  ///< of the frames
    Rigid3 T_chaser_camera{}, T_chaser_lidar{};
    std::vector<BatchFrame> frames;
    const Tracer* tracer = nullptr;  ///< of the sweeps
    std::size_t target = 0;          ///< index of the body
    RangeNoise noise{};
    std::vector<BatchSweep> sweeps;
};

/// Standard deviations, per axis, with which the commanded poses hold, independent from time to time.
struct PathSigma {
    double rotation_rad = 0, position_m = 0;
};

struct BatchOptions {
    /// False: the poses at different times have nothing to do with each other, and a state is a pose; neither a
    /// path nor a clock can then be estimated.
    bool has_motion = true;
    MotionModel motion{.acceleration_psd = 1e-3, .angular_acceleration_psd = 1e-5};
    BatchValues prior_sigma = default_batch_priors();  ///< SI; 0: known
    std::optional<PathSigma> path{};
    /// Factors on the variance of frames and of sweeps, for errors that consecutive ones have in common.
    double frame_variance = 1, sweep_variance = 1;
    int linearisations = 15;  ///< at most
};
inline constexpr std::size_t kFewestBatchTimes = 4;  ///< without motion 1
[[nodiscard]] constexpr std::size_t fewest_times(const BatchOptions& options) noexcept {
    return options.has_motion ? kFewestBatchTimes : 1;
}

/// One unknown of the model.
struct BatchEstimate {
    BatchUnknown unknown{};
    double value = 0, sigma = 0, prior_sigma = 0;  ///< SI
    bool is_determined = false;                    ///< the run has halved the prior's variance at least
};
/// A combination of unknowns, each in units of its prior's standard deviation, that the run does not determine.
struct BatchDirection {
    std::vector<double> parts;  ///< of each estimated unknown; unit length
    double sigma = 0;           ///< of the combination; 1: nothing is known beyond the prior
};
struct BatchState {
    std::int64_t t_ns = 0;
    RelativeState state{};
    Matrix12 covariance = Matrix12::Zero();  ///< motion_model.h
    Rigid3 T_chaser_target{};
    Matrix6 pose_covariance = Matrix6::Zero();  ///< pose_estimate.h, chaser axes
};
enum class BatchMeasure : std::uint8_t { points, sweep, brightness };
inline constexpr std::array<std::string_view, 3> kBatchMeasureNames{"camera", "lidar", "brightness"};

/// Of one frame, sweep, or brightness of a frame.
struct BatchResidual {
    std::int64_t t_ns = 0;
    BatchMeasure measure = BatchMeasure::points;
    std::size_t points = 0;   ///< or blocks; 0: not used
    double rms_start = 0;     ///< of the residuals, px, m or part of the mean, at its own pose by the given model,
    double rms = 0;           ///< and at the solution
    double downweighted = 0;  ///< part of the points that are outliers
    double score = 0;         ///< squared length of the whitened score, as many numbers as
    int score_numbers = 0;    ///< these
};

struct BatchResult {
    std::vector<BatchEstimate> unknowns;
    Eigen::MatrixXd covariance;  ///< of the unknowns, SI, in their order
    std::vector<BatchDirection> undetermined;
    std::vector<BatchState> states;
    std::vector<BatchResidual> residuals;  ///< frames, sweeps, brightness of frames
    bool settled = false;
    int linearisations = 0, iterations = 0;  ///< iterations: of Ceres, of all linearisations
    double cost_start = 0, cost = 0;         ///< half the sum of squared residuals
    int parameters = 0, numbers = 0;         ///< of the problem: unknowns and residuals
    std::size_t jacobian_nonzeros = 0;       ///< in its blocks
    std::string solver;                      ///< name of the linear solver
};

/// Errors: fewer than fewest_times() with measurements, no unknown or option that can be used, no
/// convergence of Ceres, a singular covariance.
[[nodiscard]] Result<BatchResult> solve_batch(const BatchInput& input, const BatchOptions& options);

}  // namespace narpa
