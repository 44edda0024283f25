#include "estimator/stereo/spline_image.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace narpa {
namespace {

/// Turns n samples into the coefficients of the spline through them, in place.
void filter(double* first, std::ptrdiff_t stride, int n) {
    if (n < 2) return;
    const double pole = std::sqrt(3.0) - 2;
    const auto at = [=](int i) -> double& { return first[i * stride]; };
    double start = 0, power = 1;  // of the causal part, the image mirrored before its first sample
    for (int i = 0; i < std::min(n, 30); ++i, power *= pole) start += power * at(i);
    at(0) = start;
    for (int i = 1; i < n; ++i) at(i) += pole * at(i - 1);
    at(n - 1) = pole / (pole * pole - 1) * (at(n - 1) + pole * at(n - 2));
    for (int i = n - 2; i >= 0; --i) at(i) = pole * (at(i + 1) - at(i));
    for (int i = 0; i < n; ++i) at(i) *= 6;
}

std::array<double, 4> weights(double t) {
    const double s = 1 - t;
    return {s * s * s / 6, 2.0 / 3 - t * t * (2 - t) / 2, 2.0 / 3 - s * s * (2 - s) / 2, t * t * t / 6};
}
std::array<double, 4> slopes(double t) {
    const double s = 1 - t;
    return {-s * s / 2, t * (1.5 * t - 2), -s * (1.5 * s - 2), t * t / 2};
}

}  // namespace

SplineImage::SplineImage(const MeasuredImage& image)
    : width_(image.width), height_(image.height), coefficients_(image.dn.begin(), image.dn.end()) {
    for (int y = 0; y < height_; ++y) filter(coefficients_.data() + std::ptrdiff_t{y} * width_, 1, width_);
    for (int x = 0; x < width_; ++x) filter(coefficients_.data() + x, width_, height_);
}

SplineImage::Sample SplineImage::sample(const Eigen::Vector2d& px) const {
    const double x = std::floor(px.x()), y = std::floor(px.y());
    const auto wx = weights(px.x() - x), wy = weights(px.y() - y);
    const auto sx = slopes(px.x() - x), sy = slopes(px.y() - y);
    const double* row = &coefficients_[(static_cast<std::size_t>(y) - 1) * static_cast<std::size_t>(width_) +
                                       static_cast<std::size_t>(x) - 1];
    Sample s;
    for (std::size_t j = 0; j < 4; ++j, row += width_) {
        const double value = wx[0] * row[0] + wx[1] * row[1] + wx[2] * row[2] + wx[3] * row[3];
        s.dn += wy[j] * value;
        s.gradient.x() += wy[j] * (sx[0] * row[0] + sx[1] * row[1] + sx[2] * row[2] + sx[3] * row[3]);
        s.gradient.y() += sy[j] * value;
    }
    return s;
}

double SplineImage::dn(const Eigen::Vector2d& px) const {
    const double x = std::floor(px.x()), y = std::floor(px.y());
    const auto wx = weights(px.x() - x), wy = weights(px.y() - y);
    const double* row = &coefficients_[(static_cast<std::size_t>(y) - 1) * static_cast<std::size_t>(width_) +
                                       static_cast<std::size_t>(x) - 1];
    double sum = 0;
    for (std::size_t j = 0; j < 4; ++j, row += width_)
        sum += wy[j] * (wx[0] * row[0] + wx[1] * row[1] + wx[2] * row[2] + wx[3] * row[3]);
    return sum;
}

}  // namespace narpa
