/// rehearsal/navigation/measurements.h - pose measurements of the target from camera frames and LiDAR sweeps.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/cloud/cloud_icp.h"
#include "estimator/features/feature_alignment.h"
#include "rehearsal/navigation/scene_model.h"
#include "rehearsal/navigation/state_estimator.h"

namespace narpa::rehearsal {

/// The pose; or none, and why, where no reliable one was found.
struct MeasurementResult {
    std::optional<TargetMeasurement> pose;
    AnswerKind answer = AnswerKind::refused;
    std::string why;
    int points = 0;  ///< feature matches that agree, or returns used
    double ms = 0;   ///< wall time
};

/// Frames of one camera: renders the model at the predicted pose and matches its features with the frame.
class CameraPoseEstimator {
public:
    /// `model` outlives it. `camera`: index in the scene.
    CameraPoseEstimator(SceneModel& model, std::size_t camera, std::uint64_t seed);

    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    /// `bytes`: in the camera's format. `t_ns`: mid-exposure, t_s after the scenario's time 0. `T_chaser_target`:
    /// predicted, body axes; `motion`: the target's in the chaser's, during the exposure. Runs on the calling
    /// thread's TBB arena.
    [[nodiscard]] MeasurementResult measure(std::span<const std::uint8_t> bytes, std::int64_t t_ns, double t_s,
                                            const Quat& q_world_chaser, const Rigid3& T_chaser_target,
                                            const ApparentMotion& motion = {});

private:
    SceneModel& model_;
    Camera camera_;
    FeatureAlignment alignment_;
};

/// Sweeps of one LiDAR: ICP of the last turn's returns, corrected for the motion to the time of its end.
class LidarPoseEstimator {
public:
    /// `model` outlives it. `lidar`: index in the scene.
    LidarPoseEstimator(SceneModel& model, std::size_t lidar)
        : model_(&model),
          lidar_(model.scene().lidars[lidar]),
          icp_(model.tracer(), model.target(),
               {.noise = range_noise_of(lidar_),
                .certain = certain_return_of(lidar_, model.scene()),
                .model = model.uncertainty()}) {}

    [[nodiscard]] const Lidar& lidar() const noexcept { return lidar_; }
    /// `sweep`: a turn; times count from t_ns. `motion`: of the target in the chaser's body axes.
    /// `position_sigma_m`, `rotation_sigma_rad`: standard deviations of `T_chaser_target`.
    [[nodiscard]] MeasurementResult measure(LidarSweep sweep, std::int64_t t_ns, const ApparentMotion& motion,
                                            const Rigid3& T_chaser_target, double position_sigma_m,
                                            double rotation_sigma_rad);

private:
    void remove_own_body(LidarSweep& sweep) const;

    SceneModel* model_;
    Lidar lidar_;
    CloudIcp icp_;
};

}  // namespace narpa::rehearsal
