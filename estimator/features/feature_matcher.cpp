#include "estimator/features/feature_matcher.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace narpa {
namespace {

/// Distance of a descriptor's best match over that of its second best (Lowe 2004).
constexpr float kRatio = 0.8f;
/// Largest forward-backward error of a tracked corner, px.
constexpr float kRoundTrip_px = 0.5f;
constexpr int kFlowWindow_px = 21, kFlowLevels = 4;
/// Part of the frame's pixels that may be brighter than the top of the scale.
constexpr double kBeyondTop = 0.002;

cv::Mat as_mat(const TonedImage& image) {
    return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

cv::Ptr<cv::Feature2D> detector(FeatureKind kind, int most) {
    switch (kind) {
        case FeatureKind::sift: return cv::SIFT::create(most);
        case FeatureKind::akaze: return cv::AKAZE::create();
        case FeatureKind::orb: return cv::ORB::create(most, 1.2f, 8, 15, 0, 2, cv::ORB::HARRIS_SCORE, 31, 10);
        case FeatureKind::corners: return {};
    }
    return {};
}

struct Described {
    std::vector<cv::KeyPoint> points;
    cv::Mat descriptors;
};

/// For each descriptor of `from` its match in `to`, or -1.
std::vector<int> best_matches(const cv::BFMatcher& matcher, const cv::Mat& from, const cv::Mat& to) {
    std::vector<std::vector<cv::DMatch>> pairs;
    matcher.knnMatch(from, to, pairs, 2);
    std::vector<int> best(static_cast<std::size_t>(from.rows), -1);
    for (const auto& pair : pairs)
        if (pair.size() == 2 && pair[0].distance < kRatio * pair[1].distance)
            best[static_cast<std::size_t>(pair[0].queryIdx)] = pair[0].trainIdx;
    return best;
}

FeatureMatch pair_of(const cv::Point2f& view, const cv::Point2f& frame) {
    return {view.x, view.y, frame.x, frame.y};
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

std::string_view name(FeatureKind kind) noexcept {
    constexpr std::array<std::string_view, 4> names{"SIFT", "AKAZE", "ORB", "corners"};
    return names[static_cast<std::size_t>(kind)];
}

struct FeatureMatcher::Impl {
    FeatureKind kind;
    int most;
    cv::Ptr<cv::Feature2D> features;

    Described describe(const TonedImage& image, const cv::Mat& mask) const {
        Described d;
        features->detect(as_mat(image), d.points, mask);
        cv::KeyPointsFilter::retainBest(d.points, most);
        features->compute(as_mat(image), d.points, d.descriptors);
        return d;
    }

    std::vector<FeatureMatch> match_descriptors(const TonedImage& view, const TonedImage& frame,
                                                const cv::Mat& mask) const {
        std::vector<FeatureMatch> matches;
        const Described a = describe(view, mask), b = describe(frame, {});
        if (a.descriptors.rows < 2 || b.descriptors.rows < 2) return matches;
        const cv::BFMatcher matcher(features->defaultNorm());
        const std::vector<int> there = best_matches(matcher, a.descriptors, b.descriptors);
        const std::vector<int> back = best_matches(matcher, b.descriptors, a.descriptors);
        for (std::size_t i = 0; i < there.size(); ++i) {
            if (there[i] < 0) continue;
            const auto j = static_cast<std::size_t>(there[i]);
            if (back[j] == static_cast<int>(i)) matches.push_back(pair_of(a.points[i].pt, b.points[j].pt));
        }
        return matches;
    }

    std::vector<FeatureMatch> follow_corners(const TonedImage& view, const TonedImage& frame,
                                             const cv::Mat& mask) const {
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
        cv::calcOpticalFlowPyrLK(frame_levels, view_levels, there, home, found_back, error, window, kFlowLevels,
                                 stop);
        for (std::size_t i = 0; i < start.size(); ++i) {
            const cv::Point2f missed = home[i] - start[i];
            if (found[i] != 0 && found_back[i] != 0 && std::hypot(missed.x, missed.y) < kRoundTrip_px)
                matches.push_back(pair_of(start[i], there[i]));
        }
        return matches;
    }
};

FeatureMatcher::FeatureMatcher(FeatureKind kind, int most)
    : impl_(std::make_unique<Impl>(Impl{kind, most, detector(kind, most)})) {}
FeatureMatcher::~FeatureMatcher() = default;
FeatureMatcher::FeatureMatcher(FeatureMatcher&&) noexcept = default;
FeatureMatcher& FeatureMatcher::operator=(FeatureMatcher&&) noexcept = default;

FeatureKind FeatureMatcher::kind() const noexcept {
    return impl_->kind;
}

std::vector<FeatureMatch> FeatureMatcher::match(const TonedImage& view, const TonedImage& frame,
                                                const std::vector<std::uint8_t>& on_target) {
    const cv::Mat mask(view.height, view.width, CV_8U, const_cast<std::uint8_t*>(on_target.data()));
    return impl_->kind == FeatureKind::corners ? impl_->follow_corners(view, frame, mask)
                                               : impl_->match_descriptors(view, frame, mask);
}

}  // namespace narpa
