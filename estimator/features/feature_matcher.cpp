#include "estimator/features/feature_matcher.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace narpa {
namespace {

/// Largest forward-backward error of a tracked corner, px.
constexpr float kRoundTrip_px = 0.5f;
constexpr int kFlowWindow_px = 21, kFlowLevels = 4;
/// Part of the frame's pixels that may be brighter than the top of the scale.
constexpr double kBeyondTop = 0.002;

cv::Mat as_mat(const TonedImage& image) {
    return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

}  // namespace

ToneScale::ToneScale(const MeasuredImage& frame, const SensorModel& sensor) : sensor_(sensor) {
    std::vector<float> dn = frame.dn;
    double top_dn = sensor.top_dn;
    if (!dn.empty()) {
        const auto rank = static_cast<std::ptrdiff_t>((1 - kBeyondTop) * static_cast<double>(dn.size() - 1));
        std::nth_element(dn.begin(), dn.begin() + rank, dn.end());
        top_dn = std::max<double>(dn[static_cast<std::size_t>(rank)], sensor.black_dn + 1);
    }
    black_ = stabilised(sensor.black_dn);
    steps_ = 255 / (stabilised(top_dn) - black_);
}

/// Has a standard deviation of 1.
double ToneScale::stabilised(double dn) const {
    const double above = dn - sensor_.black_dn, constant = sensor_.read_dn2 + sensor_.rounding_dn2;
    if (sensor_.shot_dn <= 0) return above / std::sqrt(constant);
    return 2 / sensor_.shot_dn * std::sqrt(std::max(0.0, sensor_.shot_dn * above + constant));
}

std::uint8_t ToneScale::tone(double dn) const {
    return static_cast<std::uint8_t>(std::clamp(steps_ * (stabilised(dn) - black_), 0.0, 255.0) + 0.5);
}

double ToneScale::variance() const {
    return steps_ * steps_ + 1.0 / 12;
}

TonedImage ToneScale::toned(const MeasuredImage& frame) const {
    TonedImage out{frame.width, frame.height, {}};
    out.pixels.reserve(frame.dn.size());
    for (const float dn : frame.dn) out.pixels.push_back(tone(dn));
    return out;
}

TonedImage ToneScale::toned(const RadianceImage& view) const {
    TonedImage out{view.width, view.height, {}};
    out.pixels.reserve(view.pixels.size());
    for (const Rgb& L : view.pixels) out.pixels.push_back(tone(sensor_.dn(L)));
    return out;
}

SingleThreadedOpenCv::SingleThreadedOpenCv() : before_(cv::getNumThreads()) {
    cv::setNumThreads(1);
}
SingleThreadedOpenCv::~SingleThreadedOpenCv() {
    cv::setNumThreads(before_);
}

std::vector<FeatureMatch> match_corners(const TonedImage& view, const TonedImage& frame,
                                        const std::vector<std::uint8_t>& on_target, int most) {
    const cv::Mat mask(view.height, view.width, CV_8U, const_cast<std::uint8_t*>(on_target.data()));
    std::vector<FeatureMatch> matches;
    std::vector<cv::Point2f> start, there, home;
    cv::goodFeaturesToTrack(as_mat(view), start, most, 0.01, 5, mask, 5);
    if (start.empty()) return matches;
    std::vector<cv::Mat> view_levels, frame_levels;
    const cv::Size window(kFlowWindow_px, kFlowWindow_px);
    cv::buildOpticalFlowPyramid(as_mat(view), view_levels, window, kFlowLevels);
    cv::buildOpticalFlowPyramid(as_mat(frame), frame_levels, window, kFlowLevels);
    std::vector<std::uint8_t> found, found_back;
    std::vector<float> error;
    const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 0.0005);
    cv::calcOpticalFlowPyrLK(view_levels, frame_levels, start, there, found, error, window, kFlowLevels, stop);
    cv::calcOpticalFlowPyrLK(frame_levels, view_levels, there, home, found_back, error, window, kFlowLevels, stop);
    for (std::size_t i = 0; i < start.size(); ++i) {
        const cv::Point2f missed = home[i] - start[i];
        if (found[i] != 0 && found_back[i] != 0 && std::hypot(missed.x, missed.y) < kRoundTrip_px)
            matches.push_back({start[i].x, start[i].y, there[i].x, there[i].y});
    }
    return matches;
}

Eigen::Matrix2d flow_covariance(const TonedImage& image, double variance, double u_px, double v_px, int half_px) {
    const int u0 = static_cast<int>(std::lround(u_px)), v0 = static_cast<int>(std::lround(v_px));
    const auto at = [&](int u, int v) {
        return static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(u);
    };
    Eigen::Matrix2d G = Eigen::Matrix2d::Zero();
    for (int v = std::max(1, v0 - half_px); v <= std::min(image.height - 2, v0 + half_px); ++v)
        for (int u = std::max(1, u0 - half_px); u <= std::min(image.width - 2, u0 + half_px); ++u) {
            const double gu = 0.5 * (image.pixels[at(u + 1, v)] - image.pixels[at(u - 1, v)]);
            const double gv = 0.5 * (image.pixels[at(u, v + 1)] - image.pixels[at(u, v - 1)]);
            Eigen::Matrix2d gg;
            gg << gu * gu, gu * gv, gu * gv, gv * gv;
            G += gg;
        }
    const double determinant = G.determinant(), trace = G.trace();
    if (determinant <= 1e-6 * trace * trace) return Eigen::Matrix2d::Zero();
    return variance * G.inverse();
}

}  // namespace narpa
