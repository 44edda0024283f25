#include "estimator/marks/blob_finder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "base/constants.h"
#include "estimator/least_squares/median.h"

namespace narpa {
namespace {

constexpr double kLeastSigmas = 8;
/// Parts of the brightest spot's height at which spots are cut out, so that dim ones are found beside bright ones.
constexpr std::array<double, 5> kLevels{0.8, 0.5, 0.25, 0.12, 0.06};
/// Area over that of the disc. The limits leave room for pixels that the disc covers in part.
constexpr double kLeastArea = 0.3, kMostArea = 2.5;
constexpr double kPartialPixels = 5;
/// A pixel that is less than this part of the way from the background to the spot's level counts as background:
/// noise.
constexpr double kBackground = 0.15;
constexpr int kRim_px = 1;  ///< width of the rim around the spot's pixels, which it covers in part

/// A part of the image around a spot.
struct Window {
    cv::Rect rect;
    cv::Mat dn, background;  ///< pixels there, and those of the image without what is as narrow as the spot
};

/// Centroid of the light of a spot, `component` (255 inside, of the window's size), with its blurred rim. Each
/// pixel counts by the part of it that the spot covers: where it lies between the background there and the spot's
/// level.
std::optional<Blob> measure(const Window& w, const cv::Mat& component, const SensorModel& sensor) {
    std::vector<float> inside, behind;
    for (int y = 0; y < w.dn.rows; ++y)
        for (int x = 0; x < w.dn.cols; ++x)
            if (component.at<std::uint8_t>(y, x))
                inside.push_back(w.dn.at<float>(y, x)), behind.push_back(w.background.at<float>(y, x));
    const auto bright = inside.begin() + static_cast<std::ptrdiff_t>(inside.size() * 4 / 5);
    std::nth_element(inside.begin(), bright, inside.end());
    const auto level = static_cast<double>(*bright), usual = static_cast<double>(upper_median(std::span(behind)));
    const auto stands_out = [&](double background) {
        return level - background > kLeastSigmas * std::sqrt(sensor.variance_dn2(background));
    };
    if (!stands_out(usual)) return std::nullopt;

    cv::Mat with_rim;
    cv::dilate(component, with_rim,
               cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * kRim_px + 1, 2 * kRim_px + 1}));
    const auto each_pixel = [&](auto&& take) {
        for (int y = 0; y < w.dn.rows; ++y)
            for (int x = 0; x < w.dn.cols; ++x) {
                const auto dn = static_cast<double>(w.dn.at<float>(y, x));
                const auto background = static_cast<double>(w.background.at<float>(y, x));
                if (!with_rim.at<std::uint8_t>(y, x) || !stands_out(background)) continue;
                const double part = (dn - background) / (level - background);
                take(x, y, std::clamp((part - kBackground) / (1 - kBackground), 0.0, 1.0),
                     sensor.variance_dn2(dn) / std::pow((1 - kBackground) * (level - background), 2));
            }
    };
    double sum = 0, u = 0, v = 0, mixed = 0;
    each_pixel([&](int x, int y, double part, double) {
        sum += part, u += part * x, v += part * y, mixed += part * (1 - part);
    });
    if (!(sum > 0)) return std::nullopt;
    u /= sum, v /= sum;
    PixelCovariance noise{0, 0, 0};
    each_pixel([&](int x, int y, double, double variance) {
        variance /= sum * sum;
        noise.uu += variance * (x - u) * (x - u), noise.uv += variance * (x - u) * (y - v);
        noise.vv += variance * (y - v) * (y - v);
    });
    return Blob{{u + w.rect.x, v + w.rect.y}, noise, sum, level - usual, mixed};
}

}  // namespace

std::vector<Blob> find_blobs(const MeasuredImage& image, const SensorModel& sensor, const ImageRect& within,
                             double radius_px, std::size_t most) {
    // A copy of the header alone: OpenCV takes no pointer to const.
    const cv::Mat whole(image.height, image.width, CV_32F, const_cast<float*>(image.dn.data()));  // NOLINT
    const int width = 2 * static_cast<int>(std::ceil(1.2 * radius_px + 1)) + 1;
    const auto clamped = [](double x, int size) { return static_cast<int>(std::clamp(x, 0.0, double(size))); };
    const int left = clamped(std::floor(within.x_low) - width, image.width),
              top = clamped(std::floor(within.y_low) - width, image.height),
              right = clamped(std::ceil(within.x_high) + width + 1, image.width),
              bottom = clamped(std::ceil(within.y_high) + width + 1, image.height);
    std::vector<Blob> blobs;
    if (right - left < 3 || bottom - top < 3) return blobs;
    const cv::Rect region(left, top, right - left, bottom - top);
    // What is narrower than the square stands above the opened image (white top-hat; Serra 1982).
    cv::Mat opened;
    cv::morphologyEx(whole(region), opened, cv::MORPH_OPEN,
                     cv::getStructuringElement(cv::MORPH_RECT, {width, width}));
    const cv::Mat height = whole(region) - opened;
    double highest = 0;
    cv::minMaxLoc(height, nullptr, &highest);
    const double disc_px2 = kPi * radius_px * radius_px;
    cv::Mat taken = cv::Mat::zeros(region.size(), CV_8U);
    for (const double level : kLevels) {
        const double least = level * highest;
        if (least < kLeastSigmas * std::sqrt(sensor.variance_dn2(sensor.black_dn))) break;
        cv::Mat labels, stats, centres;
        const int count = cv::connectedComponentsWithStats(height > least, labels, stats, centres, 8);
        for (int i = 1; i < count; ++i) {
            const int area = stats.at<int>(i, cv::CC_STAT_AREA);
            if (area < kLeastArea * disc_px2 - kPartialPixels || area > kMostArea * disc_px2 + kPartialPixels)
                continue;
            const cv::Rect tight(stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
                                 stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT));
            const cv::Rect box(tight.x - kRim_px, tight.y - kRim_px, tight.width + 2 * kRim_px,
                               tight.height + 2 * kRim_px);
            if ((box & cv::Rect({0, 0}, region.size())) != box) continue;  // may be cut off
            const cv::Mat component = labels(box) == i;
            if (cv::countNonZero(taken(box) & component) > 0) continue;
            taken(box).setTo(255, component);
            const cv::Rect in_image = box + region.tl();
            const auto blob = measure({in_image, whole(in_image), opened(box)}, component, sensor);
            if (!blob || blob->at.u < within.x_low || blob->at.u > within.x_high || blob->at.v < within.y_low ||
                blob->at.v > within.y_high)
                continue;
            blobs.push_back(*blob);
        }
    }
    std::ranges::stable_sort(blobs, std::ranges::greater{}, &Blob::contrast_dn);
    if (blobs.size() > most) blobs.resize(most);
    return blobs;
}

}  // namespace narpa
