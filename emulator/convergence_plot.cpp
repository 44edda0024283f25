#include "emulator/convergence_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace narpa {
namespace {

const cv::Scalar kInk{40, 40, 40}, kGrid{225, 225, 225}, kGuide{150, 150, 150};
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX, kShift = 4;  // sixteenths of a pixel
constexpr double kTextSize = 0.5, kTitleSize = 0.62;

struct Point {
    double x, y, y_error;
};

/// A logarithmic axis over a stretch of the picture.
struct Axis {
    double low, high;  ///< decades
    int from, to;      ///< pixels
    [[nodiscard]] double at(double value) const {
        return from + (std::log10(value) - low) / (high - low) * (to - from);
    }
};

/// From a little below the smallest to a little above the largest value.
Axis axis_over(const std::vector<double>& values, int from, int to) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double a = std::log10(*low), b = std::log10(*high), margin = 0.12 + 0.05 * (b - a);
    return {a - margin, b + margin, from, to};
}

cv::Point fine(double x, double y) {
    return {cvRound(x * (1 << kShift)), cvRound(y * (1 << kShift))};
}

void text(cv::Mat& image, const std::string& what, cv::Point at, double size, double align,
          const cv::Scalar& colour) {
    const cv::Size box = cv::getTextSize(what, kFont, size, 1, nullptr);
    cv::putText(image, what, {at.x - cvRound(align * box.width), at.y}, kFont, size, colour, 1, cv::LINE_AA);
}

/// 1, 2, 5 of each decade that lies on the axis.
std::vector<double> ticks(const Axis& axis) {
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(axis.low)); decade <= axis.high; ++decade)
        for (const double step : {1.0, 2.0, 5.0})
            if (const double v = step * std::pow(10.0, decade);
                std::log10(v) >= axis.low && std::log10(v) <= axis.high)
                values.push_back(v);
    return values;
}

/// Errors of one kind over x.
struct Curve {
    std::string name;
    cv::Scalar colour;
    std::vector<Point> points;
};

struct Panel {
    cv::Rect frame;
    std::string x_name;
    std::vector<double> x_ticks;  ///< empty: round numbers
    std::vector<Curve> curves;
};

void draw_axes(cv::Mat& image, const Panel& panel, const Axis& x, const Axis& y) {
    for (const double v : panel.x_ticks.empty() ? ticks(x) : panel.x_ticks) {
        const int at = cvRound(x.at(v));
        cv::line(image, {at, y.from}, {at, y.to}, kGrid, 1);
        text(image, fmt::format("{:g}", v), {at, y.from + 20}, kTextSize, 0.5, kInk);
    }
    for (const double v : ticks(y)) {
        const int at = cvRound(y.at(v));
        cv::line(image, {x.from, at}, {x.to, at}, kGrid, 1);
        text(image, fmt::format("{:g}", 100 * v), {x.from - 8, at + 5}, kTextSize, 1, kInk);
    }
    text(image, panel.x_name, {(x.from + x.to) / 2, y.from + 44}, kTextSize, 0.5, kInk);
    text(image, "RMS error, %", {x.from, y.to - 12}, kTextSize, 0, kInk);
    cv::rectangle(image, panel.frame, kInk, 1);
}

/// What independent samples would do, from the curve's first point on.
void draw_guide(cv::Mat& image, const Curve& curve, const Axis& x, const Axis& y) {
    const Point& first = curve.points.front();
    const double end = curve.points.back().x;
    const auto guide = [&](double v) { return y.at(first.y * std::sqrt(first.x / v)); };
    cv::line(image, fine(x.at(first.x), guide(first.x)), fine(x.at(end), guide(end)), kGuide, 1, cv::LINE_AA,
             kShift);
}

void draw_curve(cv::Mat& image, const Curve& curve, const Axis& x, const Axis& y) {
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const Point& p = curve.points[i];
        if (i > 0) {
            const Point& q = curve.points[i - 1];
            cv::line(image, fine(x.at(q.x), y.at(q.y)), fine(x.at(p.x), y.at(p.y)), curve.colour, 2, cv::LINE_AA,
                     kShift);
        }
        cv::line(image, fine(x.at(p.x), y.at(p.y - p.y_error)), fine(x.at(p.x), y.at(p.y + p.y_error)),
                 curve.colour, 1, cv::LINE_AA, kShift);
        cv::circle(image, fine(x.at(p.x), y.at(p.y)), 4 << kShift, curve.colour, cv::FILLED, cv::LINE_AA, kShift);
    }
}

void draw(cv::Mat& image, const Panel& panel) {
    std::vector<double> xs, ys;
    for (const Curve& curve : panel.curves)
        for (const Point& p : curve.points)
            xs.push_back(p.x), ys.push_back(p.y - p.y_error), ys.push_back(p.y + p.y_error);
    const Axis x = axis_over(xs, panel.frame.x, panel.frame.x + panel.frame.width);
    const Axis y = axis_over(ys, panel.frame.y + panel.frame.height, panel.frame.y);
    draw_axes(image, panel, x, y);
    for (const Curve& curve : panel.curves) draw_guide(image, curve, x, y);
    text(image, "grey: slope -1/2", {panel.frame.x + panel.frame.width - 12, panel.frame.y + 22}, kTextSize, 1,
         kGuide);
    int line = panel.frame.y + panel.frame.height - 14;
    for (const Curve& curve : panel.curves) {
        draw_curve(image, curve, x, y);
        text(image, curve.name, {panel.frame.x + 14, line}, kTextSize, 0, curve.colour);
        line -= 20;
    }
}

/// One kind of error of all rows, over samples and over time.
void add_curves(const ConvergencePlot& plot, const char* name, const cv::Scalar& colour, Estimate ErrorRow::*error,
                double part_of, Panel& samples, Panel& time) {
    const Estimate slope = fit_slope(plot.rows, error);
    Curve over_samples{
        fmt::format("{}: slope {:.3f} +- {:.3f}", name, slope.value, slope.standard_error), colour, {}};
    Curve over_time{name, colour, {}};
    for (std::size_t i = 0; i < plot.rows.size(); ++i) {
        const Estimate& e = plot.rows[i].*error;
        if (e.value <= 0) continue;
        const double bar = std::min(e.standard_error, 0.9 * e.value);  // a logarithm must be left of the lower end
        over_samples.points.push_back({static_cast<double>(plot.rows[i].spp), e.value / part_of, bar / part_of});
        over_time.points.push_back({plot.seconds[i], e.value / part_of, bar / part_of});
    }
    if (over_samples.points.empty()) return;
    samples.curves.push_back(std::move(over_samples));
    time.curves.push_back(std::move(over_time));
}

}  // namespace

Status write_plot(const std::string& path, const ConvergencePlot& plot) {
    Panel samples{{80, 90, 470, 400}, "samples per pixel", {}, {}},
        time{{670, 90, 470, 400}, "seconds per picture", {}, {}};
    for (const ErrorRow& r : plot.rows) samples.x_ticks.push_back(r.spp);
    add_curves(plot, "of the picture's mean", {176, 96, 16}, &ErrorRow::rmse, plot.level, samples, time);
    add_curves(plot, "of each pixel", {30, 80, 210}, &ErrorRow::relative_rmse, 1, samples, time);

    cv::Mat image(560, 1180, CV_8UC3, cv::Scalar::all(255));
    text(image, plot.title, {image.cols / 2, 34}, kTitleSize, 0.5, kInk);
    if (!samples.curves.empty()) draw(image, samples), draw(image, time);
    try {
        if (cv::imwrite(path, image)) return Ok{};
    } catch (const cv::Exception&) {
    }
    return Error{"cannot be written, expected a PNG file in a folder that exists", path, 0, 0, ErrorKind::failed};
}

}  // namespace narpa
