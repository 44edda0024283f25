/// estimator/features/feature_matcher.h - correspondences between the rendered view and the frame.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "estimator/pnp/pnp_points.h"
#include "estimator/view/measured_image.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Eight bits a pixel, row-major, linear in the light.
///
/// No tone curve: an edge pixel is the mean of a few samples, and the result of a curve depends on their number.
/// With square roots of the light, edges in views of four samples and in frames of one were 0.1 px apart, and poses
/// too far away by 3e-4 of the range.
struct ByteImage {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
    std::vector<float> variance{};  ///< of each pixel, steps^2; empty: a view, whose noise is not known
};

/// Common scale of a frame and of the views that it is compared with.
class ByteScale {
public:
    /// 255 is nearly the brightest DN of the frame.
    ByteScale(const MeasuredImage& frame, const SensorModel& sensor);

    /// With the variances of sensor noise and of rounding to eight bits.
    [[nodiscard]] ByteImage scaled(const MeasuredImage& frame) const;
    /// `gain`: ratio of the frame's light to the view's.
    [[nodiscard]] ByteImage scaled(const RadianceImage& view, double gain = 1) const;

private:
    [[nodiscard]] std::uint8_t step(double dn) const;

    SensorModel sensor_;
    double steps_per_dn_ = 1;
};

/// Pixels; the centre of the top-left one is (0, 0).
struct FeatureMatch {
    double view_u = 0, view_v = 0;
    double frame_u = 0, frame_v = 0;
    std::size_t point = 0;  ///< which of the points tracked
};

/// During its lifetime OpenCV uses only the calling threads, in the whole process; then as many as before.
class SingleThreadedOpenCv {
public:
    SingleThreadedOpenCv();
    ~SingleThreadedOpenCv();
    SingleThreadedOpenCv(const SingleThreadedOpenCv&) = delete;
    SingleThreadedOpenCv& operator=(const SingleThreadedOpenCv&) = delete;

private:
    int before_;
};

/// Half the window over which the optical flow sums.
inline constexpr int kFlowHalfWindow_px = 10;

struct CornerMatches {
    std::vector<FeatureMatch> matches;
    /// Without the coarsest levels of the pyramid more corners are found: windows there are as large as the target
    /// and show what is behind it, which a photograph has and its model has not.
    bool coarse_levels_mislead = false;
};
/// Corners of least eigenvalue (Shi and Tomasi 1994), tracked by pyramidal optical flow (Bouguet 2001) into the
/// frame and back. `most`: at most so many corners. `on_target`: mask of the view, non-zero where corners may lie.
/// `is_near`: the view's pose is nearly right, so that coarse levels may be left out where they mislead.
[[nodiscard]] CornerMatches match_corners(const ByteImage& view, const ByteImage& frame,
                                          const std::vector<std::uint8_t>& on_target, int most, bool is_near);

/// The same for given points of the view; those not found are left out.
[[nodiscard]] std::vector<FeatureMatch> track_points(const ByteImage& view, const ByteImage& frame,
                                                     std::span<const Pixel> points);

/// Covariance (px^2; u, v) of a point tracked by optical flow into `frame`, of the noise of its pixels: G^-1 (sum
/// of variance g g') G^-1 over the flow's window, g the gradients of the view and G the sum of g g'. Zero where G
/// is singular: no corner.
[[nodiscard]] UnalignedMatrix<2, 2> flow_covariance(const ByteImage& view, const ByteImage& frame,
                                                    const FeatureMatch& match);

}  // namespace narpa
