#include "estimator/view/image_shift.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace narpa {
namespace {

constexpr int kMax = kMaxComparedShift_px, kShifts = 2 * kMax + 1;
constexpr int kMostParts = 4, kFewestParts = 2, kPixelsOfPart = 3;
/// Standard deviation of the blur that detail is the difference from, over the extent of the target, and its
/// limits.
constexpr double kBlurOfExtent = 0.04, kLeastBlur_px = 2, kMostBlur_px = 8;
/// Blur of both images: a parabola through the correlations of unresolved detail is drawn to whole pixels, by up to
/// 0.25 px on renders of a body of 12,000 facets.
constexpr double kSmooth_px = 1;
/// Error of a parabola through three neighbouring correlations, px: up to 0.18 on renders of the same body at phase
/// angles from 20 to 100 degrees.
constexpr double kParabola_px = 0.1;
constexpr double kDisagree_sigmas = 3;

/// Sums over a part of the render's pixels p, with those of the frame at p + s for each shift s.
struct Sums {
    double n = 0, r = 0, rr = 0;
    cv::Mat f, ff, fr;  ///< kShifts x kShifts, of double

    static Sums zero() {
        const auto none = [] { return cv::Mat(cv::Mat::zeros(kShifts, kShifts, CV_64F)); };
        return {0, 0, 0, none(), none(), none()};
    }
    void add(const Sums& part, double sign) {
        n += sign * part.n, r += sign * part.r, rr += sign * part.rr;
        f += sign * part.f, ff += sign * part.ff, fr += sign * part.fr;
    }
    /// Pearson's correlation at each shift; 0 where one of the images is uniform.
    [[nodiscard]] cv::Mat correlation() const {
        cv::Mat out = cv::Mat::zeros(kShifts, kShifts, CV_64F);
        const double of_render = n * rr - r * r;
        for (int y = 0; y < kShifts; ++y)
            for (int x = 0; x < kShifts; ++x) {
                const double s = f.at<double>(y, x), of_frame = n * ff.at<double>(y, x) - s * s;
                if (of_render > 0 && of_frame > 1e-12 * n * ff.at<double>(y, x))
                    out.at<double>(y, x) = (n * fr.at<double>(y, x) - s * r) / std::sqrt(of_render * of_frame);
            }
        return out;
    }
};

/// Frame and render about the target: the frame's is larger by kMax on each side.
struct Images {
    cv::Mat frame, render;  ///< of float
};

/// Sums of a float image over the rectangle at each shift.
cv::Mat sums_over(const cv::Mat& integral, const cv::Rect& part) {
    cv::Mat out(kShifts, kShifts, CV_64F);
    for (int y = 0; y < kShifts; ++y)
        for (int x = 0; x < kShifts; ++x) {
            const int left = part.x + x, top = part.y + y, right = left + part.width, bottom = top + part.height;
            out.at<double>(y, x) = integral.at<double>(bottom, right) - integral.at<double>(top, right) -
                                   integral.at<double>(bottom, left) + integral.at<double>(top, left);
        }
    return out;
}

/// Of the parts of the render that are not uniform, up to kMostParts each way.
std::vector<Sums> sums_of_parts(const Images& images) {
    cv::Mat integral, integral2;
    cv::integral(images.frame, integral, integral2, CV_64F, CV_64F);
    const auto parts = [](int length) { return std::clamp(length / kPixelsOfPart, kFewestParts, kMostParts); };
    const int across = parts(images.render.cols), down = parts(images.render.rows);
    std::vector<Sums> out;
    for (int j = 0; j < down; ++j)
        for (int i = 0; i < across; ++i) {
            const int left = images.render.cols * i / across, top = images.render.rows * j / down;
            const cv::Rect part(left, top, images.render.cols * (i + 1) / across - left,
                                images.render.rows * (j + 1) / down - top);
            const cv::Mat render = images.render(part);
            Sums sums;
            cv::Mat match;
            cv::matchTemplate(images.frame({part.x, part.y, part.width + 2 * kMax, part.height + 2 * kMax}), render,
                              match, cv::TM_CCORR);
            match.convertTo(sums.fr, CV_64F);
            sums.f = sums_over(integral, part), sums.ff = sums_over(integral2, part);
            sums.n = part.area(), sums.r = cv::sum(render)[0], sums.rr = render.dot(render);
            out.push_back(std::move(sums));
        }
    return out;
}

/// Position of the peak of a parabola through three neighbouring values, relative to the middle one.
double peak(double before, double at, double after) {
    const double bend = before - 2 * at + after;
    return bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
}

struct Peak {
    Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
    bool is_at_limit = false;
};

Peak peak_of(const cv::Mat& correlation) {
    cv::Point best;
    cv::minMaxLoc(correlation, nullptr, nullptr, nullptr, &best);
    Peak out{{best.x - kMax, best.y - kMax}, false};
    out.is_at_limit = std::max(std::abs(best.x - kMax), std::abs(best.y - kMax)) == kMax;
    if (out.is_at_limit) return out;
    const auto at = [&](int dx, int dy) { return correlation.at<double>(best.y + dy, best.x + dx); };
    out.at_px.x() += peak(at(-1, 0), at(0, 0), at(1, 0));
    out.at_px.y() += peak(at(0, -1), at(0, 0), at(0, 1));
    return out;
}

struct Found {
    Peak peak;
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
    cv::Mat correlation;
};

Found find_in(const Images& images) {
    const std::vector<Sums> parts = sums_of_parts(images);
    Sums all = Sums::zero();
    for (const Sums& part : parts) all.add(part, 1);
    Found out;
    out.correlation = all.correlation();
    out.peak = peak_of(out.correlation);
    std::vector<Eigen::Vector2d> without;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Sums& part : parts) {
        if (!(part.n * part.rr - part.r * part.r > 1e-9 * part.n * all.rr / all.n)) continue;  // nothing to see
        all.add(part, -1);
        without.push_back(peak_of(all.correlation()).at_px);
        all.add(part, 1);
        mean += without.back();
    }
    const auto n = static_cast<double>(without.size());
    if (n < 2) return out.covariance = kMax * kMax * Eigen::Matrix2d::Identity(), out;
    for (const Eigen::Vector2d& w : without)
        out.covariance += (n - 1) / n * (w - mean / n) * (w - mean / n).transpose();
    out.covariance += kParabola_px * kParabola_px * Eigen::Matrix2d::Identity();
    return out;
}

/// Bounding rectangle of the lit pixels, with a border of two pixels within the image.
cv::Rect extent(const std::vector<std::uint8_t>& lit, int width, int height) {
    int left = width, top = height, right = -1, bottom = -1;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (!lit[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)])
                continue;
            left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = y;
        }
    left = std::max(0, left - 2), top = std::max(0, top - 2);
    return {left, top, std::min(width, right + 3) - left, std::min(height, bottom + 3) - top};
}

/// Without what the frame may not show: where the target reaches the border of the image, it goes on beyond.
cv::Rect within_frame(const cv::Rect& box, int width, int height) {
    const auto side = [](int from, int to, int length) {
        const int first = from == 0 ? kMax : from, last = to == length ? length - kMax : to;
        return std::pair(first, std::max(0, last - first));
    };
    const auto [left, across] = side(box.x, box.x + box.width, width);
    const auto [top, down] = side(box.y, box.y + box.height, height);
    return {left, top, across, down};
}

cv::Mat image_of(const std::vector<double>& signal, int width, int height) {
    cv::Mat out(height, width, CV_32F);
    std::ranges::transform(signal, out.begin<float>(), [](double v) { return static_cast<float>(v); });
    return out;
}

cv::Mat blurred(const cv::Mat& image, double sigma_px) {
    cv::Mat out;
    cv::GaussianBlur(image, out, {}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
    return out;
}

Images about(const cv::Rect& box, const cv::Mat& frame, const cv::Mat& render) {
    cv::Mat wide;
    cv::copyMakeBorder(frame, wide, kMax, kMax, kMax, kMax, cv::BORDER_CONSTANT, 0);
    // Without their means, sums of float keep their precision.
    const cv::Mat around = wide({box.x, box.y, box.width + 2 * kMax, box.height + 2 * kMax});
    return {around - cv::mean(around), render(box) - cv::mean(render(box))};
}

double largest_sigma(const Eigen::Matrix2d& C) {
    const double half = 0.5 * C.trace(), apart = std::hypot(0.5 * (C(0, 0) - C(1, 1)), C(0, 1));
    return std::sqrt(half + apart);
}

/// The more certain of two.
Found combined(const Found& brightness, const Found& detail) {
    Found out =
        detail.covariance.trace() < brightness.covariance.trace() && !detail.peak.is_at_limit ? detail : brightness;
    const Eigen::Vector2d apart = detail.peak.at_px - brightness.peak.at_px;
    const Eigen::Matrix2d both = brightness.covariance + detail.covariance;
    if (apart.dot(both.inverse() * apart) > kDisagree_sigmas * kDisagree_sigmas)
        out.covariance += 0.25 * apart * apart.transpose();
    return out;
}

}  // namespace

std::optional<ImageShift> find_shift(const ShiftInput& input) {
    const cv::Rect box = within_frame(extent(input.lit, input.width, input.height), input.width, input.height);
    if (std::min(box.width, box.height) < kPixelsOfPart * kFewestParts)
        return ImageShift{.not_determined = "the target fills the image, or is too small"};
    const cv::Mat frame = image_of(input.frame, input.width, input.height),
                  render = image_of(input.render, input.width, input.height);
    double low = 0, high = 0;
    cv::minMaxLoc(render(box), &low, &high);
    if (!(high - low > 1e-6 * high)) return {};
    const double blur_px = std::clamp(kBlurOfExtent * std::max(box.width, box.height), kLeastBlur_px, kMostBlur_px);
    const cv::Mat of_frame = blurred(frame, kSmooth_px), of_render = blurred(render, kSmooth_px);
    const Found brightness = find_in(about(box, of_frame, of_render));
    const Found found = combined(
        brightness, find_in(about(box, of_frame - blurred(frame, blur_px), of_render - blurred(render, blur_px))));
    ImageShift out{found.peak.at_px.x(), found.peak.at_px.y(), std::sqrt(found.covariance(0, 0)),
                   std::sqrt(found.covariance(1, 1))};
    const auto place = [](double shift_px) { return static_cast<int>(std::lround(shift_px)) + kMax; };
    out.correlation = brightness.correlation.at<double>(place(out.y_px), place(out.x_px));
    out.is_at_limit = found.peak.is_at_limit;
    if (const double sigma_px = largest_sigma(found.covariance); sigma_px > kMostUncertainShift_px)
        out.not_determined = fmt::format("parts of the image differ by {:.1f} px, expected at most {:g}", sigma_px,
                                         kMostUncertainShift_px);
    return out;
}

}  // namespace narpa
