#include "emulator/log/plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace narpa::plot {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX, kShift = 4;  // sixteenths of a pixel

cv::Point fine(cv::Point2d p) {
    return {cvRound(p.x * (1 << kShift)), cvRound(p.y * (1 << kShift))};
}

std::vector<double> logarithmic_ticks(const Axis& axis) {
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(axis.low)); decade <= axis.high; ++decade)
        for (const double step : {1.0, 2.0, 5.0})
            if (const double v = step * std::pow(10.0, decade);
                std::log10(v) >= axis.low && std::log10(v) <= axis.high)
                values.push_back(v);
    if (axis.high - axis.low > 3)  // else they would stand on each other
        std::erase_if(values, [](double v) { return std::abs(std::remainder(std::log10(v), 1.0)) > 1e-6; });
    return values;
}

std::vector<double> linear_ticks(const Axis& axis) {
    const double rough = (axis.high - axis.low) / 6, decade = std::pow(10.0, std::floor(std::log10(rough)));
    double step = 10 * decade;
    for (const double nice : {5.0, 2.0, 1.0})
        if (nice * decade >= rough) step = nice * decade;
    std::vector<double> values;
    for (double k = std::ceil(axis.low / step); k * step <= axis.high; ++k)
        values.push_back(k * step + 0.0);  // no -0
    return values;
}

}  // namespace

double Axis::at(double value) const {
    return from + ((logarithmic ? std::log10(value) : value) - low) / (high - low) * (to - from);
}

std::vector<double> Axis::ticks() const {
    return logarithmic ? logarithmic_ticks(*this) : linear_ticks(*this);
}

Axis logarithmic_axis(const std::vector<double>& values, int from, int to) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double a = std::log10(*low), b = std::log10(*high), margin = 0.12 + 0.05 * (b - a);
    return {a - margin, b + margin, from, to, true};
}

Axis linear_axis(const std::vector<double>& values, int from, int to) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const double margin = *high > *low ? 0.05 * (*high - *low) : 1;
    return {*low - margin, *high + margin, from, to, false};
}

void text(cv::Mat& image, const std::string& what, cv::Point at, double size, double align,
          const cv::Scalar& colour) {
    const cv::Size box = cv::getTextSize(what, kFont, size, 1, nullptr);
    cv::putText(image, what, {at.x - cvRound(align * box.width), at.y}, kFont, size, colour, 1, cv::LINE_AA);
}

void line(cv::Mat& image, cv::Point2d from, cv::Point2d to, const cv::Scalar& colour, int width) {
    cv::line(image, fine(from), fine(to), colour, width, cv::LINE_AA, kShift);
}

void dot(cv::Mat& image, cv::Point2d at, int radius, const cv::Scalar& colour) {
    cv::circle(image, fine(at), radius << kShift, colour, cv::FILLED, cv::LINE_AA, kShift);
}

void vertical_tick(cv::Mat& image, const Axis& x, const Axis& across, double value) {
    const int at = cvRound(x.at(value));
    cv::line(image, {at, across.from}, {at, across.to}, kGrid, 1);
    text(image, fmt::format("{:g}", value), {at, across.from + 20}, kTextSize, 0.5, kInk);
}

void horizontal_tick(cv::Mat& image, const Axis& y, const Axis& across, double value, const std::string& label) {
    const int at = cvRound(y.at(value));
    cv::line(image, {across.from, at}, {across.to, at}, kGrid, 1);
    text(image, label, {across.from - 8, at + 5}, kTextSize, 1, kInk);
}

Status write_png(const std::string& path, const cv::Mat& image) {
    try {
        if (cv::imwrite(path, image)) return Ok{};
    } catch (const cv::Exception&) {
    }
    return Error{"cannot be written, expected a PNG file in a folder that exists", path, 0, 0, ErrorKind::failed};
}

}  // namespace narpa::plot
