/// estimator/pnp/pnp_start.h - initial poses for the refinement, without a guess.
///
/// Scaled orthography with its correction for perspective (POSIT; DeMenthon and Davis, "Model-based object pose in
/// 25 lines of code"; for planes Oberkampf, DeMenthon and Davis, "Iterative pose estimation using coplanar feature
/// points") takes a microsecond and converges wherever the body is not much wider than it is distant. Elsewhere
/// OpenCV's SQPNP serves. Other sources were measured and left out: docs/pose-from-points.md.
#pragma once

#include <optional>

#include "estimator/pnp/pnp_points.h"

namespace narpa {

/// A centred point and its normalised pixel.
struct BodyPoint {
    Vec3 body_m{};  ///< from the points' mean
    Pixel seen{};   ///< where its pixel's ray meets the plane z = 1
};

/// The directions in which points spread, widest first, and their rms extent along each.
struct PointExtent {
    std::array<Vec3, 3> axis{};  ///< orthonormal, right-handed
    Vec3 rms_m{};

    /// True also where the points coincide: they leave a rotation undetermined.
    [[nodiscard]] bool is_a_line() const noexcept { return !(rms_m.y > 1e-5 * rms_m.x); }
};
[[nodiscard]] PointExtent extent_of(std::span<const BodyPoint> points);

/// Up to two poses; none where the points lie on a line, or so near that the iteration does not converge.
struct InitialPoses {
    std::array<CentredPose, 2> pose{};
    std::size_t count = 0;
};
/// `flat`: the extent along the third axis is not used, and the two attitudes that scaled orthography cannot
/// distinguish are returned. Three points are flat.
[[nodiscard]] InitialPoses orthographic_poses(std::span<const BodyPoint> points, const PointExtent& spread,
                                              bool flat);

/// Poses of three points, whose mean need not be 0; the poses are about the origin.
[[nodiscard]] InitialPoses three_point_poses(std::array<BodyPoint, 3> points);

/// The pose with the same image in scaled orthography: mirrored at the plane perpendicular to the line of sight and
/// at the body's plane of widest spread.
[[nodiscard]] CentredPose depth_reversed(const CentredPose& pose, const PointExtent& spread);

/// By OpenCV's SQPNP (Terzakis and Lourakis 2020): works at any perspective, takes some 20 times as long, and
/// allocates. Empty if it finds no pose.
[[nodiscard]] std::optional<CentredPose> sqpnp_pose(std::span<const BodyPoint> points);

}  // namespace narpa
