/// tracking/camera_calibration.h - a camera's focal lengths, principal point and distortion from images of a target
/// whose shape is known.
///
/// Points of the target are found in each image by a camera method (renders with the present model, or marks). All
/// images enter one least-squares problem (estimator/batch) with a pose each and the camera in common. With the
/// camera that it finds, points are found again, until the camera no longer changes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "emulator/world.h"
#include "estimator/batch/batch_solver.h"
#include "estimator/method/camera_method.h"

namespace narpa {

struct CalibrationImage {
    std::string file;
    MeasuredImage image;
    BodyPoses at;  ///< of the bodies; that of the target relative to the camera is where the search starts
};

struct CalibrationOptions {
    const CameraMethod* method = &camera_methods().front();
    BatchValues prior_sigma{};  ///< of the camera's unknowns (camera_change.h)
    std::uint64_t seed = 1;
    int spp = 4;         ///< of the renders
    int rounds_max = 8;  ///< in which points are found
};

/// Standard deviations of priors that suit a camera of which the field of view is known to a quarter.
[[nodiscard]] BatchValues calibration_priors(const Camera& camera);

/// One image.
struct CalibrationView {
    std::string file;
    Answer answer;           ///< of the pose found with the camera at the end
    bool is_used = false;    ///< in the solution
    Rigid3 T_camera_target;  ///< by the solution, with a covariance that includes the camera's (pose_estimate.h)
    Matrix6 covariance = Matrix6::Zero();
    BatchResidual residual{};
    std::vector<Pixel> seen, error;  ///< the points, and measured minus predicted by the solution
};

/// A number of the camera as files state it, such as fx.
struct CameraParameter {
    std::string name;
    double start = 0, value = 0, sigma = 0;
    bool is_determined = true;
};

struct CameraCalibration {
    std::shared_ptr<const CameraModel> model;
    std::vector<CameraParameter> parameters;
    Eigen::MatrixXd covariance;  ///< of the parameters, in their order
    BatchResult batch;           ///< of the changes from the camera at the start
    std::vector<CalibrationView> views;
    int rounds = 0;
    bool has_settled = false;
    double rms_px = 0;  ///< of all points' distances
};

/// Errors: priors of unknowns that are not the camera's, a distortion that its projection does not have, no image
/// with points, and those of solve_batch. Runs on the calling thread's TBB arena.
[[nodiscard]] Result<CameraCalibration> calibrate_camera(const World& world, std::size_t camera, std::size_t target,
                                                         const std::vector<CalibrationImage>& images,
                                                         const CalibrationOptions& options);

}  // namespace narpa
