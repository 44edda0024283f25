/// estimator/stereo/triangulation.h - a point from its two image points, with its covariance.
///
/// Points are in the left camera's frame (x right, y down, z forward), metres; pixels count from the centre of the
/// top-left one. The paper's section V has the printed formula.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "base/pose.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Two calibrated cameras, or one camera at two instants. Of the cameras the size, the model and, for matching, the
/// detector are used.
struct StereoPair {
    Camera left, right;
    Rigid3 T_right_left{};
};

/// The image of a point in one camera.
struct PixelMeasurement {
    Eigen::Vector2d px{0, 0};
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
};

enum class TriangulationStatus : std::uint8_t {
    good,
    behind_camera,  ///< the rays meet behind one of the cameras
    no_parallax,    ///< its depth is compatible with infinity: short baseline, far point, or on the baseline itself
    bad_input,      ///< not finite, not positive definite, no unit quaternion, or no focal length
};

struct TriangulatedPoint {
    TriangulationStatus status = TriangulationStatus::bad_input;
    /// Zero for no_parallax and bad_input.
    Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
    Eigen::Matrix3d covariance_m2 = Eigen::Matrix3d::Zero();
    double inverse_depth_1_m = 0;
    double sigma_inverse_depth_1_m = 0;  ///< infinite where the depth is not observable
    /// Standard deviations by which the rays miss each other: its square is chi-square with one degree of freedom.
    double epipolar_sigmas = 0;
};

/// The inverse depth must be this many standard deviations from zero, or there is no parallax.
inline constexpr double kMinParallax_sigmas = 3;

/// Maximum-likelihood point for Gaussian errors of both pixels: Gauss-Newton on its direction and its inverse depth
/// in the left frame, where the projections are nearly linear. The covariance is the Cramer-Rao bound at the
/// estimate, to first order. An exact left pixel is one with a very small covariance. Allocates nothing.
[[nodiscard]] TriangulatedPoint triangulate(const StereoPair& pair, const PixelMeasurement& left,
                                            const PixelMeasurement& right);

/// The depth z_l as printed in the paper (section V), from the right image's column alone: useless where the
/// baseline runs along the columns. Errors: the right column does not depend on the depth (a vertical baseline, the
/// epipole); not finite; a right camera that is not a pinhole.
[[nodiscard]] Result<double> printed_depth_m(const StereoPair& pair, const Eigen::Vector2d& left_px,
                                             const Eigen::Vector2d& right_px);

}  // namespace narpa
