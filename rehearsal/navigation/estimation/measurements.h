/// rehearsal/navigation/estimation/measurements.h - pose measurements of the target from camera frames and LiDAR
/// sweeps.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>

#include "estimator/cloud/cloud_icp.h"
#include "estimator/method/camera_method.h"
#include "rehearsal/navigation/estimation/frame_history.h"
#include "rehearsal/navigation/estimation/scene_model.h"
#include "rehearsal/navigation/estimation/state_estimator.h"

namespace narpa::rehearsal {

/// The filter's prediction of the target before a measurement; body axes of the chaser.
struct Prediction {
    double t_s = 0;  ///< after the scenario's time 0
    Quat q_world_chaser{};
    Rigid3 T_chaser_target{};
    ApparentMotion motion{};
    double position_sigma_m = 0, rotation_sigma_rad = 0;
};

/// A pose; or none and the reason, if no reliable one was found.
struct MeasurementResult {
    std::optional<TargetMeasurement> pose;
    AnswerKind answer = AnswerKind::refused;
    std::string why;
    int points = 0;  ///< feature matches that agree, pixels, or returns used
    double ms = 0;   ///< wall time
};

/// Frames of one camera: renders the model at the predicted pose and compares. Refuses frames that it has had
/// before.
class CameraPoseEstimator {
public:
    /// `model` outlives it. `camera`: index in the scene.
    CameraPoseEstimator(SceneModel& model, std::size_t camera, const CameraMethod& method, std::uint64_t seed);

    CameraPoseEstimator(const CameraPoseEstimator&) = delete;  // history_ refers to camera_
    CameraPoseEstimator& operator=(const CameraPoseEstimator&) = delete;

    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    /// `bytes`: in the camera's format. `t_ns`: mid-exposure, the time of `predicted`. Runs on the calling thread's
    /// TBB arena.
    [[nodiscard]] MeasurementResult measure(std::span<const std::uint8_t> bytes, std::int64_t t_ns,
                                            const Prediction& predicted);

private:
    SceneModel& model_;
    Camera camera_;
    FrameHistory history_{camera_};
    const CameraMethod& method_;
    std::unique_ptr<FrameEstimator> estimator_;
    std::uint64_t frames_ = 0;  ///< estimated so far
};

/// Sweeps of one LiDAR: ICP of the last turn's returns, corrected for motion to the end of the turn.
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
    /// `sweep`: a turn; times count from t_ns, the time of `predicted`.
    [[nodiscard]] MeasurementResult measure(LidarSweep sweep, std::int64_t t_ns, const Prediction& predicted);

private:
    SceneModel* model_;
    Lidar lidar_;
    CloudIcp icp_;
};

}  // namespace narpa::rehearsal
