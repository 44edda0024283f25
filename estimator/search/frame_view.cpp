#include "estimator/search/frame_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace narpa {

NoiseScale::NoiseScale(const SensorModel& sensor)
    : black_dn_(sensor.black_dn),
      read_dn2_(std::max(sensor.read_dn2 + sensor.rounding_dn2, 1e-12)),
      shot_dn_(sensor.shot_dn) {}

double NoiseScale::operator()(double dn) const noexcept {
    const double signal = dn - black_dn_;
    if (signal <= 0 || shot_dn_ <= 0) return signal / std::sqrt(read_dn2_);
    return 2 / shot_dn_ * (std::sqrt(read_dn2_ + shot_dn_ * signal) - std::sqrt(read_dn2_));
}

FrameView::FrameView(const MeasuredImage& frame)
    : width_(frame.width),
      height_(frame.height),
      sums_(static_cast<std::size_t>(width_ + 1) * static_cast<std::size_t>(height_ + 1)) {
    const auto at = [&](int x, int y) -> double& { return sums_[static_cast<std::size_t>(y * (width_ + 1) + x)]; };
    for (int y = 0; y < height_; ++y) {
        double row = 0;
        for (int x = 0; x < width_; ++x) {
            row += static_cast<double>(frame.at(x, y));
            at(x + 1, y + 1) = at(x + 1, y) + row;
        }
    }
}

double FrameView::sum_to(double x, double y) const noexcept {
    const int i = std::min(static_cast<int>(x), width_ - 1), j = std::min(static_cast<int>(y), height_ - 1);
    const double u = x - i, v = y - j;
    const double* row = sums_.data() + static_cast<std::size_t>(j * (width_ + 1) + i);
    const double* next = row + width_ + 1;
    return (1 - v) * ((1 - u) * row[0] + u * row[1]) + v * ((1 - u) * next[0] + u * next[1]);
}

double FrameView::mean(double x, double y, double side) const noexcept {
    const double half = 0.5 * side;
    const auto interval = [half](double at, int size) {
        const double begin = std::clamp(at + 0.5 - half, 0.0, size - 1e-3);
        return std::pair{begin, std::clamp(at + 0.5 + half, begin + 1e-3, static_cast<double>(size))};
    };
    const auto [left, right] = interval(x, width_);
    const auto [top, bottom] = interval(y, height_);
    const double sum = sum_to(right, bottom) - sum_to(left, bottom) - sum_to(right, top) + sum_to(left, top);
    return sum / ((right - left) * (bottom - top));
}

}  // namespace narpa
