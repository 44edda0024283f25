#include "renderer/optics/point_spread.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

namespace narpa {
namespace {

constexpr int kGrid = 128;  ///< period on which the filter is computed, pixels
constexpr double kLightBeyond = 2e-3;
/// Terms are added while their singular value exceeds this share of the largest.
constexpr double kMinTerm = 1e-4;

/// The filter over a period of kGrid pixels, centred on (0, 0).
cv::Mat1d periodic_filter(const PointSpreadFunction& spread) {
    cv::Mat2d spectrum(kGrid, kGrid);
    for (int j = 0; j < kGrid; ++j)
        for (int i = 0; i < kGrid; ++i) {
            const auto frequency = [](int k) {
                return (k <= kGrid / 2 ? k : k - kGrid) / static_cast<double>(kGrid);
            };
            const std::complex<double> t = transfer(spread, frequency(i), frequency(j));
            spectrum(j, i) = {t.real(), t.imag()};
        }
    cv::Mat2d complex;
    cv::dft(spectrum, complex, cv::DFT_INVERSE | cv::DFT_SCALE);
    cv::Mat1d filter;
    cv::extractChannel(complex, filter, 0);
    return filter;
}

double at(const cv::Mat1d& periodic, int x, int y) {
    return periodic((y + kGrid) % kGrid, (x + kGrid) % kGrid);
}

int radius_of(const cv::Mat1d& periodic) {
    double inside = at(periodic, 0, 0);
    for (int r = 0;; ++r) {
        if (std::abs(1 - inside) < kLightBeyond || r == kPointSpreadReach_px) return r;
        for (int k = -r; k <= r; ++k)
            inside +=
                at(periodic, k, r + 1) + at(periodic, k, -r - 1) + at(periodic, r + 1, k) + at(periodic, -r - 1, k);
        for (const int x : {-r - 1, r + 1})
            for (const int y : {-r - 1, r + 1}) inside += at(periodic, x, y);
    }
}

/// Distributes the light beyond the widest filter over the filter, weighted with the squared distance from its
/// centre: this changes only the transfer of the lowest frequencies. Scaling the filter instead would change all
/// frequencies, by up to 1.7 times as much.
void add_light_beyond(cv::Mat1d& square, int radius) {
    const double beyond = 1 - cv::sum(square)[0];
    if (beyond < kLightBeyond) return;
    cv::Mat1d outer(square.size());
    for (int j = 0; j < outer.rows; ++j)
        for (int i = 0; i < outer.cols; ++i)
            outer(j, i) = (i - radius) * (i - radius) + (j - radius) * (j - radius);
    square += beyond / cv::sum(outer)[0] * outer;
}

/// Complex product of finite numbers, without the library's handling of infinities.
std::complex<double> times(std::complex<double> a, std::complex<double> b) {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

/// The sum of sample(x, y) e^(-2 pi i (fx (x - centre_x) + fy (y - centre_y))) at (fx, fy) cycles a sample:
/// Horner's rule in x and y.
std::complex<double> fourier_sum(const PointSpreadImage& image, double fx, double fy) {
    const auto phase = [](double cycles) { return std::polar(1.0, -2 * std::numbers::pi * cycles); };
    const std::complex<double> one_x = phase(fx), one_y = phase(fy);
    std::complex<double> sum = 0;
    for (std::size_t at = image.samples.size(); at > 0;) {
        std::complex<double> row = 0;
        for (int x = 0; x < image.width; ++x) row = times(row, one_x) + image.samples[--at];
        sum = times(sum, one_y) + row;
    }
    return times(sum, phase(-fx * image.centre_x - fy * image.centre_y));
}

}  // namespace

std::complex<double> transfer(const PointSpreadFunction& spread, double fx, double fy) noexcept {
    using std::numbers::pi;
    const double f = std::hypot(fx, fy);
    std::complex<double> t = std::exp(-2 * pi * pi * spread.sigma_px * spread.sigma_px * f * f);
    if (spread.cutoff_per_px > 0) {
        const double v = std::min(f / spread.cutoff_per_px, 1.0);
        t *= 2 / pi * (std::acos(v) - v * std::sqrt(1 - v * v));
    }
    if (spread.image) {
        const double gx = fx / spread.samples_per_px, gy = fy / spread.samples_per_px;
        const bool in_band = std::max(std::abs(gx), std::abs(gy)) <= 0.5;
        t = in_band ? times(t, fourier_sum(*spread.image, gx, gy)) : 0;
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
    add_light_beyond(square, filter.radius);
    const cv::SVD parts(square / cv::sum(square)[0]);
    const double largest = parts.w.at<double>(0);
    double sum = 0;
    for (int k = 0; k < size && parts.w.at<double>(k) > kMinTerm * largest; ++k) {
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
