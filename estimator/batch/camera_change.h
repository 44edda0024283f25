/// estimator/batch/camera_change.h - a camera whose focal lengths, principal point and distortion differ from the
/// model's.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>

#include "base/result.h"
#include "estimator/batch/batch_unknowns.h"
#include "renderer/projection/brown_conrady.h"
#include "renderer/projection/camera_model.h"

namespace narpa {

/// The unknowns of a camera, in the order of ChangedImage::by_camera.
inline constexpr std::array kCameraUnknowns{BatchUnknown::focal,    BatchUnknown::aspect, BatchUnknown::centre_x,
                                            BatchUnknown::centre_y, BatchUnknown::k1,     BatchUnknown::k2,
                                            BatchUnknown::p1,       BatchUnknown::p2,     BatchUnknown::k3};

/// Image point of a point of the scene through the changed camera, and its derivatives.
struct ChangedImage {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, kCameraUnknowns.size()> by_camera;
};

/// Cheap to make, unlike a CameraModel with its tables: a solver makes one for each step.
class ChangedCamera {
public:
    /// `model` outlives it.
    ChangedCamera(const CameraModel& model, const BatchValues& change);
    /// `p`: camera axes. False if it has no image.
    [[nodiscard]] bool project(const Vec3& p, ChangedImage& out) const;

private:
    Pinhole pinhole_{};
    const CameraModel* base_;  ///< what follows the distortion; null: `pinhole_`
    BrownDistortion distortion_;
    Eigen::Vector2d centre_, stretch_, shift_;
    double stretch_by_focal_ = 1;  ///< of y
};

/// The model with this change. Errors: a distortion of a camera that has another model than that of OpenCV.
[[nodiscard]] Result<std::shared_ptr<const CameraModel>> changed_camera(const CameraModel& model,
                                                                        const BatchValues& change);

}  // namespace narpa
