/// tracking/single_estimate.h - the pose of a target from one frame or one sweep, with covariance and bound, beside
/// the truth or the guess: what `narpa estimate SCENE` and the Python package return. Runs on the calling thread's
/// TBB arena.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>

#include "estimator/cloud/cloud_icp.h"
#include "estimator/cloud/range_points.h"
#include "protocols/ledger.h"
#include "tracking/target_tracker.h"

namespace narpa {

/// Target and sensor of an estimate, and the pose that it is compared with.
struct EstimatedPose {
    std::string target, sensor, sensor_kind;  ///< the last: "camera", "cameras" or "lidar"
    Rigid3 T_world_sensor{}, known{};         ///< `known`: T_sensor_target, the truth or the guess
    bool known_is_guess = false;
};
/// The estimate T_sensor_target beside what is known; `passed` if it is usable.
[[nodiscard]] nlohmann::json pose_document(const EstimatedPose& of, const Rigid3& T, const Matrix6& covariance,
                                           const Matrix6& bound, const Answer& answer);

/// Ledger of a frame with the exposure of the scene.
[[nodiscard]] FrameLedger nominal_ledger(const Camera& camera, std::int64_t t_ns);

/// What is estimated from: a frame in the camera's format, or a sweep.
template <class Measurement>
struct SingleMeasurement {
    std::size_t sensor = 0;  ///< index of the camera or LiDAR in the scene
    std::int64_t t_ns = 0;   ///< middle of the exposure, or the sweep's first shot
    Measurement measured{};
    /// The target's pose in the world is a guess; else it is the truth, from which the guess is made as the options
    /// state.
    bool world_is_guess = false;
    std::optional<Rigid3> guess{};  ///< T_sensor_target, in place of the target's pose in the world
};

struct FrameEstimate {
    EstimatedPose of;
    TrackedFrame tracked;
};
/// Errors: those of target_of and FrameTracker::create.
[[nodiscard]] Result<FrameEstimate> estimate_one_frame(
    const World& world, const SingleMeasurement<std::span<const std::uint8_t>>& frame, TrackerOptions options);
[[nodiscard]] nlohmann::json document(const FrameEstimate& estimate);

struct SweepEstimate {
    EstimatedPose of;
    CloudEstimate cloud;
    [[nodiscard]] bool has_pose() const noexcept;
};
/// The motion during the sweep is that between its time and this much later.
inline constexpr std::int64_t kSweepMotion_ns = 10'000'000;
/// Leaves out the returns of the body that carries the LiDAR. Times of the points count from `t_ns`. Errors: those
/// of target_of; a sweep without enough points.
[[nodiscard]] Result<SweepEstimate> estimate_one_sweep(const World& world, SingleMeasurement<LidarSweep> sweep,
                                                       const TrackerOptions& options);
[[nodiscard]] nlohmann::json document(const SweepEstimate& estimate);

}  // namespace narpa
