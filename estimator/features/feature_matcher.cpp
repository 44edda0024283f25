#include "estimator/features/feature_matcher.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace narpa {
namespace {

/// Largest forward-backward error of a tracked corner, px.
constexpr float kRoundTrip_px = 0.5f;
constexpr int kFlowWindow_px = 2 * kFlowHalfWindow_px + 1, kFlowLevels = 4;
/// Where fewer than this part of the corners are found, fewer levels are tried, as long as they find more by this
/// factor.
constexpr double kEnoughFound = 0.9, kMoreFound = 1.1;
constexpr int kFewestFlowLevels = 2;
/// Part of the frame's pixels that may be brighter than the top of the scale.
constexpr double kBeyondTop = 0.002;
/// Variance of rounding to whole steps.
constexpr double kRoundingVariance = 1.0 / 12;

cv::Mat as_mat(const ByteImage& image) {
    return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

/// Optical flow from a view into a frame and back.
class Flow {
public:
    Flow(const ByteImage& view, const ByteImage& frame) {
        cv::buildOpticalFlowPyramid(as_mat(view), view_levels_, kWindow, kFlowLevels);
        cv::buildOpticalFlowPyramid(as_mat(frame), frame_levels_, kWindow, kFlowLevels);
    }

    [[nodiscard]] std::vector<FeatureMatch> track(const std::vector<cv::Point2f>& start, int levels) const {
        std::vector<cv::Point2f> there, home;
        std::vector<std::uint8_t> found, found_back;
        std::vector<float> error;
        const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 0.0005);
        cv::calcOpticalFlowPyrLK(view_levels_, frame_levels_, start, there, found, error, kWindow, levels, stop);
        cv::calcOpticalFlowPyrLK(frame_levels_, view_levels_, there, home, found_back, error, kWindow, levels,
                                 stop);
        std::vector<FeatureMatch> matches;
        for (std::size_t i = 0; i < start.size(); ++i) {
            const cv::Point2f missed = home[i] - start[i];
            if (found[i] != 0 && found_back[i] != 0 && std::hypot(missed.x, missed.y) < kRoundTrip_px)
                matches.push_back({start[i].x, start[i].y, there[i].x, there[i].y, i});
        }
        return matches;
    }

private:
    inline static const cv::Size kWindow{kFlowWindow_px, kFlowWindow_px};
    std::vector<cv::Mat> view_levels_, frame_levels_;
};

}  // namespace

ByteScale::ByteScale(const MeasuredImage& frame, const SensorModel& sensor) : sensor_(sensor) {
    std::vector<float> dn = frame.dn;
    double top_dn = sensor.top_dn;
    if (!dn.empty()) {
        const auto rank = static_cast<std::ptrdiff_t>((1 - kBeyondTop) * static_cast<double>(dn.size() - 1));
        std::nth_element(dn.begin(), dn.begin() + rank, dn.end());
        top_dn = std::max<double>(dn[static_cast<std::size_t>(rank)], sensor.black_dn + 1);
    }
    steps_per_dn_ = 255 / (top_dn - sensor.black_dn);
}

std::uint8_t ByteScale::step(double dn) const {
    return static_cast<std::uint8_t>(std::clamp(steps_per_dn_ * (dn - sensor_.black_dn), 0.0, 255.0) + 0.5);
}

ByteImage ByteScale::scaled(const MeasuredImage& frame) const {
    ByteImage out{frame.width, frame.height, {}};
    out.pixels.reserve(frame.dn.size()), out.variance.reserve(frame.dn.size());
    for (const float value : frame.dn) {
        const auto dn = static_cast<double>(value);
        out.pixels.push_back(step(dn));
        out.variance.push_back(
            static_cast<float>(steps_per_dn_ * steps_per_dn_ * sensor_.variance_dn2(dn) + kRoundingVariance));
    }
    return out;
}

ByteImage ByteScale::scaled(const RadianceImage& view, double gain) const {
    ByteImage out{view.width, view.height, {}};
    out.pixels.reserve(view.pixels.size());
    for (const Rgb& L : view.pixels)
        out.pixels.push_back(step(sensor_.black_dn + gain * (sensor_.dn(L) - sensor_.black_dn)));
    return out;
}

SingleThreadedOpenCv::SingleThreadedOpenCv() : before_(cv::getNumThreads()) {
    cv::setNumThreads(1);
}
SingleThreadedOpenCv::~SingleThreadedOpenCv() {
    cv::setNumThreads(before_);
}

CornerMatches match_corners(const ByteImage& view, const ByteImage& frame,
                            const std::vector<std::uint8_t>& on_target, int most, bool is_near) {
    const cv::Mat mask(view.height, view.width, CV_8U, const_cast<std::uint8_t*>(on_target.data()));
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(as_mat(view), corners, most, 0.01, 5, mask, 5);
    if (corners.empty()) return {};
    const Flow flow(view, frame);
    CornerMatches out{flow.track(corners, kFlowLevels)};
    for (int levels = kFlowLevels - 1; levels >= kFewestFlowLevels; --levels) {
        if (static_cast<double>(out.matches.size()) >= kEnoughFound * static_cast<double>(corners.size())) break;
        std::vector<FeatureMatch> found = flow.track(corners, levels);
        if (static_cast<double>(found.size()) <= kMoreFound * static_cast<double>(out.matches.size())) break;
        out.coarse_levels_mislead = true;
        if (!is_near) break;
        out.matches = std::move(found);
    }
    return out;
}

std::vector<FeatureMatch> track_points(const ByteImage& view, const ByteImage& frame,
                                       std::span<const Pixel> points) {
    if (points.empty()) return {};
    std::vector<cv::Point2f> start;
    for (const Pixel& p : points) start.emplace_back(static_cast<float>(p.u), static_cast<float>(p.v));
    return Flow(view, frame).track(start, kFlowLevels);
}

UnalignedMatrix<2, 2> flow_covariance(const ByteImage& view, const ByteImage& frame, const FeatureMatch& match) {
    const int view_u = static_cast<int>(std::lround(match.view_u)),
              view_v = static_cast<int>(std::lround(match.view_v)),
              frame_u = static_cast<int>(std::lround(match.frame_u)),
              frame_v = static_cast<int>(std::lround(match.frame_v));
    const auto index = [](const ByteImage& image, int u, int v) {
        return static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(u);
    };
    Eigen::Matrix2d G = Eigen::Matrix2d::Zero(), of_noise = Eigen::Matrix2d::Zero();
    for (int dv = -kFlowHalfWindow_px; dv <= kFlowHalfWindow_px; ++dv)
        for (int du = -kFlowHalfWindow_px; du <= kFlowHalfWindow_px; ++du) {
            const int u = view_u + du, v = view_v + dv;
            if (u < 1 || v < 1 || u > view.width - 2 || v > view.height - 2) continue;
            const Eigen::Vector2d g(
                0.5 * (view.pixels[index(view, u + 1, v)] - view.pixels[index(view, u - 1, v)]),
                0.5 * (view.pixels[index(view, u, v + 1)] - view.pixels[index(view, u, v - 1)]));
            const int there_u = std::clamp(frame_u + du, 0, frame.width - 1),
                      there_v = std::clamp(frame_v + dv, 0, frame.height - 1);
            const double variance = static_cast<double>(frame.variance[index(frame, there_u, there_v)]) +
                                    kRoundingVariance;  // rounding of the view
            G += g * g.transpose();
            of_noise += variance * g * g.transpose();
        }
    const double determinant = G.determinant(), trace = G.trace();
    if (determinant <= 1e-6 * trace * trace) return Eigen::Matrix2d::Zero();
    const Eigen::Matrix2d inverse = G.inverse();
    return inverse * of_noise * inverse;
}

}  // namespace narpa
