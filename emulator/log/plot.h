/// emulator/log/plot.h - what the plots of the benches are drawn with: axes, curves and words on an OpenCV picture.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "base/result.h"

namespace narpa::plot {

inline const cv::Scalar kInk{40, 40, 40}, kGrid{225, 225, 225}, kGuide{150, 150, 150};
inline constexpr double kTextSize = 0.5, kTitleSize = 0.62;

/// An axis over a stretch of the picture.
struct Axis {
    double low, high;  ///< values, or their decades
    int from, to;      ///< pixels
    bool logarithmic;
    [[nodiscard]] double at(double value) const;
    /// Round values that lie on the axis: 1, 2, 5 of each decade, or about six in steps of such a number.
    [[nodiscard]] std::vector<double> ticks() const;
};
/// From a little below the smallest to a little above the largest value; at least one value.
[[nodiscard]] Axis logarithmic_axis(const std::vector<double>& values, int from, int to);
[[nodiscard]] Axis linear_axis(const std::vector<double>& values, int from, int to);

/// `align`: 0 the text begins there, 1/2 its middle lies there, 1 it ends there.
void text(cv::Mat& image, const std::string& what, cv::Point at, double size, double align,
          const cv::Scalar& colour);
/// Smooth line and dot, at parts of a pixel.
void line(cv::Mat& image, cv::Point2d from, cv::Point2d to, const cv::Scalar& colour, int width);
void dot(cv::Mat& image, cv::Point2d at, int radius, const cv::Scalar& colour);
/// A grid line across `across` with its value beside the axis.
void vertical_tick(cv::Mat& image, const Axis& x, const Axis& across, double value);
void horizontal_tick(cv::Mat& image, const Axis& y, const Axis& across, double value, const std::string& label);

[[nodiscard]] Status write_png(const std::string& path, const cv::Mat& image);

}  // namespace narpa::plot
