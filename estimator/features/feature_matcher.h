/// estimator/features/feature_matcher.h - correspondences between the rendered view and the frame.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "estimator/view/measured_image.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Eight bits a pixel, row-major, variance-stabilised: the generalised Anscombe transform of DN (Murtagh, Starck
/// and Bijaoui 1995), so that one step is the same number of standard deviations everywhere.
struct TonedImage {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
};

/// The tone curve of a frame and of the views that it is compared with.
class ToneScale {
public:
    /// 255 is nearly the brightest DN of the frame.
    ToneScale(const MeasuredImage& frame, const SensorModel& sensor);

    [[nodiscard]] TonedImage toned(const MeasuredImage& frame) const;
    [[nodiscard]] TonedImage toned(const RadianceImage& view) const;
    /// Variance of a pixel of a toned frame in steps^2: sensor noise, and rounding to eight bits.
    [[nodiscard]] double variance() const;

private:
    [[nodiscard]] double stabilised(double dn) const;
    [[nodiscard]] std::uint8_t tone(double dn) const;

    SensorModel sensor_;
    double black_ = 0, steps_ = 1;  ///< 255 / (top - black), stabilised
};

/// Pixels; the centre of the top-left one is (0, 0).
struct FeatureMatch {
    double view_u = 0, view_v = 0;
    double frame_u = 0, frame_v = 0;
};

/// While it exists OpenCV uses the calling threads alone, in the whole process; then as many as before.
class SingleThreadedOpenCv {
public:
    SingleThreadedOpenCv();
    ~SingleThreadedOpenCv();
    SingleThreadedOpenCv(const SingleThreadedOpenCv&) = delete;
    SingleThreadedOpenCv& operator=(const SingleThreadedOpenCv&) = delete;

private:
    int before_;
};

/// Corners of least eigenvalue (Shi and Tomasi 1994), tracked by pyramidal optical flow (Bouguet 2001) into the
/// frame and back. `most`: at most so many corners. `on_target`: mask of the view, non-zero where corners may lie.
[[nodiscard]] std::vector<FeatureMatch> match_corners(const TonedImage& view, const TonedImage& frame,
                                                      const std::vector<std::uint8_t>& on_target, int most);

/// Covariance (px^2; u, v) of a point tracked by optical flow, for independent noise of this `variance` in the
/// pixels of the image that it is tracked to: variance * (sum of g g' over the window)^-1, g the image gradients.
/// The window reaches `half_px` to each side. Zero where the sum is singular: no corner.
[[nodiscard]] Eigen::Matrix2d flow_covariance(const TonedImage& image, double variance, double u_px, double v_px,
                                              int half_px);

}  // namespace narpa
