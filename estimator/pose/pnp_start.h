/// estimator/pose/pnp_start.h - poses to refine from, where there is no guess.
///
/// Scaled orthography with its correction for perspective (POSIT; DeMenthon and Davis, "Model-based object pose in
/// 25 lines of code"; for planes Oberkampf, DeMenthon and Davis, "Iterative pose estimation using coplanar feature
/// points") costs a microsecond and serves wherever the body is not much wider than it is far. OpenCV's solvers
/// serve everywhere.
#pragma once

#include <vector>

#include "estimator/pose/pnp_points.h"

namespace narpa {

/// Centred points and their normalised pixels, gathered from a PnpPoints or a sample of it.
struct BodyPoint {
    Vec3 body_m{};  ///< from the points' mean
    Pixel seen{};   ///< where its pixel's ray meets the plane z = 1
};

/// The directions in which points spread, widest first, and their rms extent along each.
struct PointExtent {
    std::array<Vec3, 3> axis{};  ///< orthonormal, right-handed
    Vec3 rms_m{};
};
[[nodiscard]] PointExtent spread_of(std::span<const BodyPoint> points);

/// Up to two poses; none where the points lie on a line, or so near that the iteration does not settle.
struct PoseStarts {
    std::array<CentredPose, 2> pose{};
    std::size_t count = 0;
};
/// `flat`: the points' depth along the third axis is not used, and the two attitudes that scaled orthography cannot
/// tell apart come out. Three points are flat.
[[nodiscard]] PoseStarts orthographic_starts(std::span<const BodyPoint> points, const PointExtent& spread,
                                             bool flat);

/// Of three points, whose mean need not be 0; the poses are about the origin.
[[nodiscard]] PoseStarts triple_starts(std::array<BodyPoint, 3> points);

/// The same image in scaled orthography: mirrored in the plane across the line of sight and in the body's plane of
/// widest spread.
[[nodiscard]] CentredPose depth_reversed(const CentredPose& pose, const PointExtent& spread);

/// By OpenCV: SQPNP (Terzakis and Lourakis 2020), and IPPE (Collins and Bartoli 2014) where `flat`, of which both
/// solutions come. Added to `out`; allocates.
void opencv_starts(std::span<const BodyPoint> points, bool flat, std::vector<CentredPose>& out);
/// Up to four poses of three points, by OpenCV's AP3P (Ke and Roumeliotis 2017). Added to `out`; allocates.
void opencv_p3p(const std::array<BodyPoint, 3>& points, std::vector<CentredPose>& out);

}  // namespace narpa
