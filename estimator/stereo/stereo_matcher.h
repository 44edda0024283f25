/// estimator/stereo/stereo_matcher.h - points of a scene from two frames of known relative pose.
///
/// Corners of the left frame (Shi and Tomasi 1994) are searched along their epipolar lines in the right one, first
/// to the whole pixel, as in the paper's section V, then to subpixels. A point is the centre of its corner's left
/// pixel, so that the left pixel is exact and the error is the match's alone. In place of corners, the pixels of a
/// grid can be matched, for a depth map.
///
/// Errors of matches in scenes/descent (200 points, 500 x 500 pixels, detector noise of about a seventieth of the
/// signal): 0.026 px along the epipolar line and 0.016 px across it, as predicted within a tenth; without noise
/// 0.029 and 0.015, where the predicted variance is 1.5 times too small. They are limited by relief within a patch,
/// along the line, and by aliasing.
///
/// Frames of distorting lenses are first resampled (bicubic) to the images of pinholes with the same focal lengths
/// and principal points, as epipolar lines must be straight. Pixels of StereoPoint refer to these images; points
/// outside them are not matched.
#pragma once

#include <optional>
#include <vector>

#include "estimator/stereo/patch_match.h"
#include "estimator/stereo/triangulation.h"

namespace narpa {

/// Left camera's frame.
struct StereoSphere {
    Vec3 centre_m{};
    double radius_m = 0;
};

struct StereoSettings {
    int points_max = 100;                  ///< the strongest corners that pass all checks
    int grid_px = 0;                       ///< > 0: instead of corners, all pixels of a grid of this spacing
    double nearest_m = 0, farthest_m = 0;  ///< depths in the left frame between which points are searched
    std::optional<StereoSphere> within{};  ///< points are also searched within this sphere only
    int patch_radius_px = 9;               ///< 2 .. 50; the smaller, the less relief and the more noise
};

struct StereoPoint {
    Eigen::Vector2d left_px{0, 0};  ///< whole, exact
    WholePixelMatch whole;          ///< in the right frame
    SubPixelMatch match;            ///< in the right frame
    TriangulatedPoint point;        ///< from `match`
    double range_m_per_px = 0;      ///< change of its range per shift of the match along the epipolar line

    /// Standard deviation of its range: the error lies along the left pixel's ray.
    [[nodiscard]] double range_sigma_m() const;
};

/// Number of corners by outcome.
struct StereoCounts {
    int accepted = 0;
    int outside = 0;       ///< its ray does not meet the sphere
    int flat = 0;          ///< the patch has no contrast beyond noise
    int cut_off = 0;       ///< the patch, or all of its epipolar line, is outside a frame or saturated
    int unlike = 0;        ///< correlation below kMinCorrelation
    int ambiguous = 0;     ///< another place along the line correlates nearly as well
    int inconsistent = 0;  ///< the search from the right frame ends elsewhere in the left one
    int unsettled = 0;     ///< the subpixel fit does not converge
    int off_line = 0;      ///< more than kFarthestOff_sigmas from the epipolar line
    int without_depth = 0;
};
inline constexpr double kMinCorrelation = 0.8, kMaxAmbiguity = 0.7, kFarthestOff_sigmas = 3;

struct StereoPoints {
    std::vector<StereoPoint> points;
    StereoCounts counts;
};

/// "accepted 80, flat 12, ...": the outcomes that occurred.
[[nodiscard]] std::string to_text(const StereoCounts& counts);

/// In the order of the corners' strength, or of the grid's rows, on all threads of the calling thread's TBB arena.
/// Errors: a frame that is not its camera's size, a pair that cannot be triangulated, depths that are no range.
[[nodiscard]] Result<StereoPoints> match_stereo(const StereoPair& pair, const MeasuredImage& left,
                                                const MeasuredImage& right, const StereoSettings& settings);

/// The left pixel of a match, exact by definition, as a measurement.
[[nodiscard]] PixelMeasurement exact_pixel(const Eigen::Vector2d& px);

}  // namespace narpa
