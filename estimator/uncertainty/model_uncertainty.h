/// estimator/uncertainty/model_uncertainty.h - uncertainty of the model that an estimator uses.
///
/// A nuisance p of standard deviation s that the estimator does not solve for shifts its answer by dx/dp s. Such
/// errors do not average out over pixels, so their covariance, the sum of (dx/dp s)(dx/dp s)', is added to that of
/// the noise ("consider" parameters; S. Schmidt, Application of state-space methods to navigation problems, 1966).
/// For images most of these shifts are known in closed form from the pose alone.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>

#include "estimator/pose/apparent_motion.h"
#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// Standard deviations. 0: exact.
struct ModelUncertainty {
    double scale = 0;          ///< of the target's size, as a part of it
    double mesh_m = 0;         ///< of the mesh's position in the target's axes, per axis
    double albedo = 0;         ///< of its brightness, as a part of it
    double light_rad = 0;      ///< of the light's direction in the target's axes: Sun, or the target's own attitude
    double focal = 0;          ///< of the focal length, as a part of it
    double boresight_rad = 0;  ///< of the sensor's axes, about each
    double range_bias_m = 0;   ///< of a LiDAR, the same for all its ranges
    double clock_s = 0;        ///< of the time of the measurement
    /// Of brightness, over the target's RMS: details and reflectance that the model lacks. Neighbouring pixels
    /// share them, over a distance that the estimator finds in its residuals. For images.
    double detail = 0;

    friend bool operator==(const ModelUncertainty&, const ModelUncertainty&) = default;
};

/// Their names in files and options, where angles are degrees.
struct ModelErrorName {
    std::string_view name;
    double ModelUncertainty::*field;
    double unit;
};
inline constexpr std::array<ModelErrorName, 8> kModelErrors{{
    {"scale", &ModelUncertainty::scale, 1},
    {"mesh_m", &ModelUncertainty::mesh_m, 1},
    {"albedo", &ModelUncertainty::albedo, 1},
    {"light_deg", &ModelUncertainty::light_rad, kDegree},
    {"focal", &ModelUncertainty::focal, 1},
    {"boresight_deg", &ModelUncertainty::boresight_rad, kDegree},
    {"range_bias_m", &ModelUncertainty::range_bias_m, 1},
    {"clock_s", &ModelUncertainty::clock_s, 1},
}};
/// The same, of errors that estimators are told, and that no scene is made with.
inline constexpr std::array<ModelErrorName, 1> kToldErrors{{{"detail", &ModelUncertainty::detail, 1}}};

/// Columns: the shifts of the pose, (rotation rad, translation m) as in pose_estimate.h, by one standard deviation
/// of each nuisance. Their covariance is the matrix times its transpose.
using PoseShifts = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::DontAlign, 6, 16>;

/// Shifts by mesh_m, boresight_rad and clock_s, which act on the poses of every sensor alike. `motion`: the
/// target's, in sensor axes.
[[nodiscard]] PoseShifts pose_shifts(const ModelUncertainty& u, const Rigid3& T_sensor_target,
                                     const ApparentMotion& motion);
/// The same, plus the shifts by scale and focal length for a camera. `by_focal`: the shift of a fit to points
/// (pnp_refine.h), if the estimator has points; none: that of a target which is small compared with its range.
[[nodiscard]] PoseShifts image_shifts(const ModelUncertainty& u, const Rigid3& T_camera_target,
                                      const ApparentMotion& motion, const std::optional<Vector6>& by_focal = {});
/// The columns of both.
[[nodiscard]] PoseShifts joined(const PoseShifts& a, const PoseShifts& b);

/// Covariance of the pose's error due to these shifts: shifts shifts'.
[[nodiscard]] Matrix6 covariance_by(const PoseShifts& shifts);

}  // namespace narpa
