#include "renderer/camera/point_spread.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

namespace narpa {
namespace {

constexpr int kGrid = 128;  ///< pixels of the period on which the filter is computed
constexpr int kMostRadius = 31;
constexpr double kLightBeyond = 2e-3;
/// Terms are added until what is missing is below this share of the largest.
constexpr double kLeastTerm = 1e-4;

/// Over a period of kGrid pixels, its middle at (0, 0).
cv::Mat1d periodic_filter(const PointSpreadFunction& spread) {
    cv::Mat2d spectrum(kGrid, kGrid);
    for (int j = 0; j < kGrid; ++j)
        for (int i = 0; i < kGrid; ++i) {
            const auto frequency = [](int k) {
                return (k <= kGrid / 2 ? k : k - kGrid) / static_cast<double>(kGrid);
            };
            spectrum(j, i) = {transfer(spread, frequency(i), frequency(j)), 0};
        }
    cv::Mat1d filter;
    cv::dft(spectrum, filter, cv::DFT_INVERSE | cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
    return filter;
}

double at(const cv::Mat1d& periodic, int x, int y) {
    return periodic((y + kGrid) % kGrid, (x + kGrid) % kGrid);
}

int radius_of(const cv::Mat1d& periodic) {
    double inside = at(periodic, 0, 0);
    for (int r = 0;; ++r) {
        if (std::abs(1 - inside) < kLightBeyond || r == kMostRadius) return r;
        for (int k = -r; k <= r; ++k)
            inside +=
                at(periodic, k, r + 1) + at(periodic, k, -r - 1) + at(periodic, r + 1, k) + at(periodic, -r - 1, k);
        for (const int x : {-r - 1, r + 1})
            for (const int y : {-r - 1, r + 1}) inside += at(periodic, x, y);
    }
}

}  // namespace

double transfer(const PointSpreadFunction& spread, double fx, double fy) noexcept {
    using std::numbers::pi;
    const double f = std::hypot(fx, fy);
    double t = std::exp(-2 * pi * pi * spread.sigma_px * spread.sigma_px * f * f);
    if (spread.cutoff_per_px > 0) {
        const double v = std::min(f / spread.cutoff_per_px, 1.0);
        t *= 2 / pi * (std::acos(v) - v * std::sqrt(1 - v * v));
    }
    return t;
}

SeparableFilter filter_of(const PointSpreadFunction& spread) {
    const cv::Mat1d periodic = periodic_filter(spread);
    SeparableFilter filter;
    filter.radius = radius_of(periodic);
    const int size = 2 * filter.radius + 1;
    cv::Mat1d square(size, size);
    for (int j = 0; j < size; ++j)
        for (int i = 0; i < size; ++i) square(j, i) = at(periodic, i - filter.radius, j - filter.radius);
    const cv::SVD parts(square / cv::sum(square)[0]);
    const double largest = parts.w.at<double>(0);
    double sum = 0;
    for (int k = 0; k < size && parts.w.at<double>(k) > kLeastTerm * largest; ++k) {
        SeparableFilter::Term term;
        double columns = 0, rows = 0;
        for (int i = 0; i < size; ++i) {
            term.column.push_back(static_cast<float>(parts.w.at<double>(k) * parts.u.at<double>(i, k)));
            term.row.push_back(static_cast<float>(parts.vt.at<double>(k, i)));
            columns += static_cast<double>(term.column.back()), rows += static_cast<double>(term.row.back());
        }
        sum += columns * rows;
        filter.terms.push_back(std::move(term));
    }
    for (auto& term : filter.terms)
        for (float& weight : term.column) weight = static_cast<float>(static_cast<double>(weight) / sum);
    return filter;
}

}  // namespace narpa
