/// estimator/stereo/patch_match.h - matches a patch of one image in another: to the whole pixel, then to subpixels.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "base/pose.h"
#include "estimator/pose/pose_estimate.h"
#include "estimator/stereo/spline_image.h"
#include "estimator/view/measured_image.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {

class EpipolarWarp {
public:
    EpipolarWarp(const Pinhole& from, const Pinhole& to, const Rigid3& T_to_from);

    [[nodiscard]] Eigen::Vector3d ray(const Eigen::Vector2d& px) const {
        return origin_ + px.x() * across_ + px.y() * down_;
    }
    /// True if the point is in front of the other camera.
    [[nodiscard]] bool is_before(const Eigen::Vector3d& ray, double inverse_depth) const {
        return ray.z() + inverse_depth * t_.z() > 0;
    }
    [[nodiscard]] Eigen::Vector2d px(const Eigen::Vector3d& ray, double inverse_depth) const {
        const Eigen::Vector3d q = ray + inverse_depth * t_;
        const auto [x, y] = to_.of_plane(q.x() / q.z(), q.y() / q.z());
        return {x, y};
    }
    /// Change of `px` per change of the inverse depth: along the epipolar line.
    [[nodiscard]] Eigen::Vector2d px_slope(const Eigen::Vector3d& ray, double inverse_depth) const {
        const Eigen::Vector3d q = ray + inverse_depth * t_;
        const auto [x, y] = to_.jacobian({q.x(), q.y(), q.z()});
        return {dot(x, to_vec3(t_)), dot(y, to_vec3(t_))};
    }
    /// The inverse depth at which `px` has this coordinate (0 column, 1 row), where the epipolar line crosses it.
    [[nodiscard]] double inverse_depth_at(const Eigen::Vector3d& ray, int axis, double coordinate_px) const {
        const double n = to_.on_plane({coordinate_px, coordinate_px})[axis];
        return (ray[axis] - n * ray.z()) / (n * t_.z() - t_[axis]);
    }
    /// Inverse depth in the other camera's frame.
    [[nodiscard]] double inverse_depth_there(const Eigen::Vector3d& ray, double inverse_depth) const {
        return inverse_depth / (ray.z() + inverse_depth * t_.z());
    }

private:
    Eigen::Vector3d origin_, across_, down_, t_;
    Pinhole to_;
};

/// Low-pass filter before interpolation: weights of a pixel and its neighbours each way. It removes the frequencies
/// that alias at a step between two pixels, and reduces the variance of noise to kSoftNoise.
inline constexpr double kSoftNeighbour = 0.125, kSoftMiddle = 1 - 2 * kSoftNeighbour;
inline constexpr double kSoftNoise = (kSoftMiddle * kSoftMiddle + 2 * kSoftNeighbour * kSoftNeighbour) *
                                     (kSoftMiddle * kSoftMiddle + 2 * kSoftNeighbour * kSoftNeighbour);

/// A camera's image, prepared for matching.
struct StereoView {
    Camera camera;
    SensorModel sensor;
    MeasuredImage image,
        soft;            ///< as taken; low-pass filtered against aliasing in the interpolation
    SplineImage spline;  ///< of the soft one

    StereoView(const Camera& c, const MeasuredImage& frame);
};

/// A square of whole pixels about a whole pixel; can be reused.
struct Patch {
    int u = 0, v = 0, radius_px = 0;
    std::vector<double> dn;  ///< row-major, 2 radius + 1 each way

    [[nodiscard]] Eigen::Vector2d centre_px() const { return {u, v}; }
};
/// False where the square leaves the image or a pixel of it is saturated.
[[nodiscard]] bool cut_patch(const StereoView& view, int u, int v, int radius_px, Patch& patch);

struct InverseDepths {
    double low = 0, high = 0;  ///< 1 / m, in the frame of the patch's camera
};

struct WholePixelMatch {
    Eigen::Vector2d px{0, 0};  ///< whole
    double inverse_depth = 0;  ///< of the point of the epipolar line nearest to it
    double correlation = 0;    ///< normalised: -1 .. 1
    /// (1 - correlation) over that of the best match at least kApart_px away: near 0 is unique, near 1 is
    /// ambiguous.
    double ambiguity = 0;
};
inline constexpr double kApart_px = 3;

/// The best of the whole pixels along the epipolar line between two inverse depths, by correlation with the patch
/// warped as a plane that faces the patch's camera at that depth. Nothing where none lies inside the image.
[[nodiscard]] std::optional<WholePixelMatch> search_line(const Patch& patch, const EpipolarWarp& warp,
                                                         const StereoView& there, const InverseDepths& range);

struct SubPixelMatch {
    Eigen::Vector2d px{0, 0};
    Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
    /// Sum of squared residuals over its expected value. Above 1 it scales the covariance.
    double misfit = 0;
};

/// Least squares on a shift, the relief (slopes and small curvatures of the inverse depth), gain and offset: Lucas
/// and Kanade 1981 with the homography of the plane. Pixels are weighted by the sensors' noise, the unmodelled
/// error of their positions, and a Gaussian window; the covariance follows from the same. Nothing where it does not
/// converge within a pixel and a half of the whole-pixel match.
[[nodiscard]] std::optional<SubPixelMatch> fit_patch(const Patch& patch, const StereoView& here,
                                                     const EpipolarWarp& warp, const StereoView& there,
                                                     const WholePixelMatch& start);

}  // namespace narpa
