// The picture of bench/loop.h: for each camera a row of panels, for each run a curve.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "bench/loop.h"
#include "emulator/log/plot.h"

namespace narpa {
namespace {

using namespace plot;

constexpr int kLeft = 90, kTop = 80, kWidth = 430, kHeight = 330, kColumn = kWidth + 100, kRow = kHeight + 120;
const std::array<cv::Scalar, 3> kColours{{{176, 96, 16}, {30, 80, 210}, {60, 140, 40}}};
constexpr double kLeastMs = 1e-3;  // a logarithm needs something

/// How many frames exceed a time: in steps, from the first to the one frame that took longest.
struct Curve {
    std::string name;
    cv::Scalar colour;
    std::vector<cv::Point2d> points;  ///< ms, fraction of frames
};

struct Panel {
    cv::Point at;
    std::string x_name;
    bool logarithmic;
    std::vector<Curve> curves;
};

template <class H>
std::vector<cv::Point2d> exceedance(const H& h, double least_ms) {
    std::vector<cv::Point2d> points;
    const auto n = static_cast<double>(h.count());
    // The k-th largest; all of the last hundred, then fewer and fewer.
    for (double k = n; k >= 1; k = std::min(k - 1, std::floor(k * (k > 100 ? 0.97 : 1))))
        points.push_back({std::max(least_ms, h.percentile_ns((n - k + 1) / n) * 1e-6), k / n});
    return points;
}

void draw(cv::Mat& image, const Panel& panel) {
    std::vector<double> xs, ys;
    for (const Curve& c : panel.curves)
        for (const cv::Point2d& p : c.points) xs.push_back(p.x), ys.push_back(p.y);
    if (xs.empty()) return;
    if (!panel.logarithmic) xs.push_back(0);
    const int right = panel.at.x + kWidth, bottom = panel.at.y + kHeight;
    const Axis x = panel.logarithmic ? logarithmic_axis(xs, panel.at.x, right) : linear_axis(xs, panel.at.x, right);
    const Axis y = logarithmic_axis(ys, bottom, panel.at.y);
    for (const double v : x.ticks()) vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) horizontal_tick(image, y, x, v, fmt::format("{:g}", 100 * v));
    if (!panel.logarithmic) line(image, {x.at(0), y.at(ys.back())}, {x.at(0), y.at(1)}, kGuide, 2);
    text(image, panel.x_name, {(x.from + x.to) / 2, y.from + 44}, kTextSize, 0.5, kInk);
    text(image, "frames that exceed it, %", {x.from, y.to - 12}, kTextSize, 0, kInk);
    int row = bottom - 14;
    for (const Curve& c : panel.curves) {
        for (std::size_t i = 0; i < c.points.size(); ++i) {
            const cv::Point2d here{x.at(c.points[i].x), y.at(c.points[i].y)};
            if (i > 0) {
                const cv::Point2d last{x.at(c.points[i - 1].x), y.at(c.points[i - 1].y)};
                line(image, last, {last.x, here.y}, c.colour, 2);
                line(image, {last.x, here.y}, here, c.colour, 2);
            }
        }
        if (!c.points.empty()) dot(image, {x.at(c.points.back().x), y.at(c.points.back().y)}, 4, c.colour);
        text(image, c.name, {panel.at.x + 14, row}, kTextSize, 0, c.colour);
        row -= 20;
    }
    cv::rectangle(image, cv::Rect(panel.at.x, panel.at.y, kWidth, kHeight), kInk, 1);
}

}  // namespace

Status write_plot(const std::string& path, const std::string& title, const std::vector<LoopRun>& runs) {
    const std::size_t cameras = runs.empty() ? 0 : runs.front().cameras.size();
    cv::Mat image(kTop + kRow * static_cast<int>(cameras), kLeft + 3 * kColumn, CV_8UC3, cv::Scalar::all(255));
    text(image, title, {image.cols / 2, 34}, kTitleSize, 0.5, kInk);
    for (std::size_t camera = 0; camera < cameras; ++camera) {
        const int top = kTop + kRow * static_cast<int>(camera);
        const std::string name = runs.front().cameras[camera].name;
        std::array<Panel, 3> panels{
            {{{kLeft, top}, name + ": woken late, ms", true, {}},
             {{kLeft + kColumn, top}, name + ": mid-exposure to hand-over, ms", true, {}},
             {{kLeft + 2 * kColumn, top}, name + ": hand-over after the deadline, ms", false, {}}}};
        for (std::size_t i = 0; i < runs.size(); ++i) {
            const CameraStats& s = runs[i].cameras[camera].stats;
            const cv::Scalar& colour = kColours[i % kColours.size()];
            panels[0].curves.push_back({runs[i].name, colour, exceedance(s.wake_late, kLeastMs)});
            panels[1].curves.push_back({runs[i].name, colour, exceedance(s.hand_over, kLeastMs)});
            panels[2].curves.push_back({runs[i].name, colour, exceedance(s.late, -1e9)});
        }
        for (const Panel& panel : panels) draw(image, panel);
    }
    return write_png(path, image);
}

}  // namespace narpa
