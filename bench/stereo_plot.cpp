// The picture of bench/stereo.h, after the paper's figure of section V.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "bench/stereo.h"
#include "emulator/log/plot.h"

namespace narpa {
namespace {

using namespace plot;

constexpr int kTop = 90, kSide = 500, kLeft = 30, kPanel = 380, kFirstPanel = kLeft + kSide + 90, kGap = 90;
const cv::Scalar kWhole{30, 80, 210}, kFine{176, 96, 16}, kMark{60, 220, 250};
/// What lies below this part of a box's lower quartile is drawn there: a logarithm must end somewhere.
constexpr double kFloor = 0.1;

/// The left frame, its light shown by square roots, and over it where each feature moves in the right one.
void draw_matches(cv::Mat& image, const StereoBench& bench) {
    const MeasuredImage& frame = bench.left;
    cv::Mat grey(frame.height, frame.width, CV_8U);
    for (int y = 0; y < frame.height; ++y)
        for (int x = 0; x < frame.width; ++x)
            grey.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(
                255 * std::sqrt(std::clamp(frame.at(x, y) / bench.left_top_dn, 0.0, 1.0)));
    const double scale = static_cast<double>(kSide) / std::max(frame.width, frame.height);
    cv::Mat colour;
    cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
    cv::resize(colour, colour, {}, scale, scale, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    const auto at = [&](const Eigen::Vector2d& px) {
        return cv::Point2d((px.x() + 0.5) * scale - 0.5, (px.y() + 0.5) * scale - 0.5);
    };
    for (const StereoBenchPoint& p : bench.points) {
        line(colour, at(p.left_px), at(p.right_px), kMark, 1);
        dot(colour, at(p.left_px), 3, kWhole);
    }
    colour.copyTo(image(cv::Rect(kLeft, kTop, colour.cols, colour.rows)));
    text(image, "left frame; lines lead to the place in the right one", {kLeft, kTop - 12}, kTextSize, 0, kInk);
}

/// Quartiles as a box, whiskers, and each value beyond as a cross.
void draw_box(cv::Mat& image, const Axis& y, double middle, const std::vector<double>& values,
              const cv::Scalar& colour) {
    constexpr double kHalf = 24;
    const Spread s = spread(values);
    const auto up = [&](double v) { return y.at(std::max(v, std::pow(10, y.low))); };
    const auto level = [&](double v, double half, int width) {
        line(image, {middle - half, up(v)}, {middle + half, up(v)}, colour, width);
    };
    level(s.lower_quartile, kHalf, 1), level(s.upper_quartile, kHalf, 1), level(s.median, kHalf, 2);
    level(s.low, kHalf / 2, 1), level(s.high, kHalf / 2, 1);
    for (const double side : {-kHalf, kHalf})
        line(image, {middle + side, up(s.lower_quartile)}, {middle + side, up(s.upper_quartile)}, colour, 1);
    line(image, {middle, up(s.low)}, {middle, up(s.lower_quartile)}, colour, 1);
    line(image, {middle, up(s.upper_quartile)}, {middle, up(s.high)}, colour, 1);
    for (const double v : values) {
        if (v >= s.low && v <= s.high) continue;
        line(image, {middle - 4, up(v)}, {middle + 4, up(v)}, colour, 1);
        line(image, {middle, up(v) - 4}, {middle, up(v) + 4}, colour, 1);
    }
}

/// `per_range`: in parts of each point's range, %.
void draw_errors(cv::Mat& image, const StereoBench& bench, int left, bool per_range) {
    const auto values = [&](bool fine, int axis) {
        std::vector<double> v;
        for (const StereoBenchPoint& p : bench.points)
            v.push_back(std::abs((fine ? p.fine_error_m : p.whole_error_m)[axis]) *
                        (per_range ? 100 / p.truth_m.norm() : 1));
        return v;
    };
    std::vector<double> shown;
    for (const bool fine : {false, true})
        for (int axis = 0; axis < 3; ++axis) {
            const Spread s = spread(values(fine, axis));
            shown.push_back(std::max(s.low, kFloor * s.lower_quartile)), shown.push_back(s.largest);
        }
    std::erase_if(shown, [](double v) { return !(v > 0); });
    if (shown.empty()) return;
    const Axis x{0, 3, left, left + kPanel, false}, y = logarithmic_axis(shown, kTop + kSide, kTop);
    for (const double v : y.ticks()) horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};
    for (int axis = 0; axis < 3; ++axis) {
        text(image, kAxes[static_cast<std::size_t>(axis)], {cvRound(x.at(axis + 0.5)), kTop + kSide + 22},
             kTextSize, 0.5, kInk);
        draw_box(image, y, x.at(axis + 0.28), values(false, axis), kWhole);
        draw_box(image, y, x.at(axis + 0.72), values(true, axis), kFine);
    }
    text(image, per_range ? "error over range, %" : "error, m", {left, kTop - 12}, kTextSize, 0, kInk);
    cv::rectangle(image, cv::Rect(left, kTop, kPanel, kSide), kInk, 1);
}

}  // namespace

Status write_plot(const std::string& path, const StereoBench& bench) {
    cv::Mat image(kTop + kSide + 70, kFirstPanel + 2 * kPanel + kGap + 30, CV_8UC3, cv::Scalar::all(255));
    text(image,
         fmt::format(
             "{}: {} points, depth {:.1f} times better between pixels; squared error over predicted variance "
             "{:.2f}",
             bench.scene, bench.points.size(), bench.gain(), bench.mean_normalised_squared()),
         {image.cols / 2, 34}, kTitleSize, 0.5, kInk);
    draw_matches(image, bench);
    draw_errors(image, bench, kFirstPanel, false);
    draw_errors(image, bench, kFirstPanel + kPanel + kGap, true);
    text(image, "whole pixels", {kFirstPanel, kTop + kSide + 50}, kTextSize, 0, kWhole);
    text(image, "between pixels", {kFirstPanel + 130, kTop + kSide + 50}, kTextSize, 0, kFine);
    text(image, "box: quartiles; +: beyond 1.5 of its heights", {kFirstPanel + 290, kTop + kSide + 50}, kTextSize,
         0, kInk);
    return write_png(path, image);
}

}  // namespace narpa
