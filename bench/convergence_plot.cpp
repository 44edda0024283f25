#include "bench/convergence_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "emulator/log/plot.h"

namespace narpa {
namespace {

using namespace plot;

struct Point {
    double x, y, y_error;
};

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
    for (const double v : panel.x_ticks.empty() ? x.ticks() : panel.x_ticks) vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) horizontal_tick(image, y, x, v, fmt::format("{:g}", 100 * v));
    text(image, panel.x_name, {(x.from + x.to) / 2, y.from + 44}, kTextSize, 0.5, kInk);
    text(image, "RMS error, %", {x.from, y.to - 12}, kTextSize, 0, kInk);
    cv::rectangle(image, panel.frame, kInk, 1);
}

/// What independent samples would do, from the curve's first point on.
void draw_guide(cv::Mat& image, const Curve& curve, const Axis& x, const Axis& y) {
    const Point& first = curve.points.front();
    const double end = curve.points.back().x;
    const auto guide = [&](double v) { return y.at(first.y * std::sqrt(first.x / v)); };
    line(image, {x.at(first.x), guide(first.x)}, {x.at(end), guide(end)}, kGuide, 1);
}

void draw_curve(cv::Mat& image, const Curve& curve, const Axis& x, const Axis& y) {
    for (std::size_t i = 0; i < curve.points.size(); ++i) {
        const Point& p = curve.points[i];
        if (i > 0) {
            const Point& q = curve.points[i - 1];
            line(image, {x.at(q.x), y.at(q.y)}, {x.at(p.x), y.at(p.y)}, curve.colour, 2);
        }
        line(image, {x.at(p.x), y.at(p.y - p.y_error)}, {x.at(p.x), y.at(p.y + p.y_error)}, curve.colour, 1);
        dot(image, {x.at(p.x), y.at(p.y)}, 4, curve.colour);
    }
}

void draw(cv::Mat& image, const Panel& panel) {
    std::vector<double> xs, ys;
    for (const Curve& curve : panel.curves)
        for (const Point& p : curve.points)
            xs.push_back(p.x), ys.push_back(p.y - p.y_error), ys.push_back(p.y + p.y_error);
    const Axis x = logarithmic_axis(xs, panel.frame.x, panel.frame.x + panel.frame.width);
    const Axis y = logarithmic_axis(ys, panel.frame.y + panel.frame.height, panel.frame.y);
    draw_axes(image, panel, x, y);
    for (const Curve& curve : panel.curves) draw_guide(image, curve, x, y);
    text(image, "grey: slope -1/2", {panel.frame.x + panel.frame.width - 12, panel.frame.y + 22}, kTextSize, 1,
         kGuide);
    int row = panel.frame.y + panel.frame.height - 14;
    for (const Curve& curve : panel.curves) {
        draw_curve(image, curve, x, y);
        text(image, curve.name, {panel.frame.x + 14, row}, kTextSize, 0, curve.colour);
        row -= 20;
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
    return write_png(path, image);
}

}  // namespace narpa
