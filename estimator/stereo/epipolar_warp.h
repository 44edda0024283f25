/// estimator/stereo/epipolar_warp.h - warp of pixels from one pinhole camera to another for a given inverse depth.
///
/// A pixel's ray in the other camera's frame, at unit depth in its own, is affine in the pixel; on a plane the
/// inverse depth is affine too. A patch of a plane is therefore warped exactly, by the homography that the plane
/// induces.
#pragma once

#include <Eigen/Core>

#include "base/pose.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/camera/camera_model.h"

namespace narpa {

class EpipolarWarp {
public:
    EpipolarWarp(const Pinhole& from, const Pinhole& to, const Rigid3& T_to_from);

    [[nodiscard]] Eigen::Vector3d ray(const Eigen::Vector2d& px) const {
        return origin_ + px.x() * across_ + px.y() * down_;
    }
    /// Is the point in front of the other camera?
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

}  // namespace narpa
