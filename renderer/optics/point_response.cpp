#include "renderer/optics/point_response.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr int kSteps = PointResponse::kSteps;
constexpr double kPeriod_px = 128;     ///< period on which the response is computed
constexpr double kHighest = 8;         ///< cycles per pixel
constexpr double kHighestOfImage = 3;  ///< the same for a point spread given as an image
constexpr int kMaxRadius = kPointSpreadReach_px;

double sinc(double x) {
    return x == 0 ? 1 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
}

/// Radius beyond which at most 0.2 % of the light falls: of a Gaussian exp(-r^2 / 2 sigma^2), of an aperture about
/// 2 / (pi^2 cutoff r).
int radius_of(const PointSpreadFunction& spread, double disc_px) {
    double radius = 3.5 * spread.sigma_px + 0.5 * disc_px;
    if (spread.cutoff_per_px > 0) radius += 101 / spread.cutoff_per_px;
    if (spread.image) {
        const PointSpreadImage& i = *spread.image;
        radius += std::max({i.centre_x, i.width - 1 - i.centre_x, i.centre_y, i.height - 1 - i.centre_y}) /
                  spread.samples_per_px;
    }
    return static_cast<int>(std::ceil(std::min<double>(radius, kMaxRadius - 1))) + 1;
}

/// Transfer function of a uniform disc at f cycles per pixel: 2 J1(pi d f) / (pi d f).
double disc_transfer(double disc_px, double f) {
    const double x = std::numbers::pi * disc_px * f;
    return x < 1e-6 ? 1 : 2 * ::j1(x) / x;
}

/// The point spread without its image, the only part that may be asymmetric.
PointSpreadFunction symmetric_part(PointSpreadFunction spread) {
    spread.image = nullptr;
    return spread;
}

/// The highest frequency with a significant transfer, in units of 1 / kPeriod_px. A disc's transfer falls with
/// f^-1.5; the limit for it keeps its edge sharp to 2 %.
int highest_frequency(const PointSpreadFunction& spread, double disc_px) {
    double highest = kHighest;
    if (disc_px > 0) highest = std::min(highest, 27 / disc_px);
    if (spread.image) highest = std::min({highest, kHighestOfImage, 0.5 * spread.samples_per_px});
    const PointSpreadFunction symmetric = symmetric_part(spread);
    int k = 1;
    while (k < highest * kPeriod_px && transfer(symmetric, k / kPeriod_px, 0).real() > 1e-7) ++k;
    return k;
}

/// Spectrum of the light that a pixel receives from a point at its centre: lens times pixel, at frequencies (kx,
/// ky) >= 0. A box of 1/8 px suppresses ringing from the cut-off at the highest frequency.
cv::Mat1d symmetric_spectrum(const PointSpreadFunction& spread, double disc_px, int n) {
    const PointSpreadFunction symmetric = symmetric_part(spread);
    const auto pixel = [](double f) { return sinc(f) * sinc(f / kHighest) / kPeriod_px; };
    cv::Mat1d spectrum(n + 1, n + 1);
    for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= j; ++i) {
            const double fx = i / kPeriod_px, fy = j / kPeriod_px;
            double t = transfer(symmetric, fx, fy).real() * pixel(fx) * pixel(fy);
            if (disc_px > 0) t *= disc_transfer(disc_px, std::hypot(fx, fy));
            spectrum(j, i) = spectrum(i, j) = t;
        }
    return spectrum;
}

/// e^(2 pi i k x / kPeriod_px) for each position x and each k of low .. high.
cv::Mat2d waves(const std::vector<double>& x_px, int low, int high) {
    cv::Mat2d out(static_cast<int>(x_px.size()), high - low + 1);
    for (int row = 0; row < out.rows; ++row)
        for (int k = low; k <= high; ++k) {
            const double phase = 2 * std::numbers::pi * k * x_px[static_cast<std::size_t>(row)] / kPeriod_px;
            out(row, k - low) = {std::cos(phase), std::sin(phase)};
        }
    return out;
}

/// Fourier sum of the image at frequencies (0 .. n, -n .. n), with the sign convention of `transfer`.
cv::Mat2d image_spectrum(const PointSpreadImage& image, double samples_per_px, int n) {
    std::vector<double> x, y;  // negated, because the sum has e^(-2 pi i f x)
    for (int i = 0; i < image.width; ++i) x.push_back((image.centre_x - i) / samples_per_px);
    for (int j = 0; j < image.height; ++j) y.push_back((image.centre_y - j) / samples_per_px);
    cv::Mat2d samples(image.height, image.width);
    for (int j = 0; j < image.height; ++j)
        for (int i = 0; i < image.width; ++i)
            samples(j, i) = {image.samples[static_cast<std::size_t>(j * image.width + i)], 0};
    return cv::Mat(waves(y, -n, n).t() * samples * waves(x, 0, n));
}

/// Share of a point's light that a pixel receives, by the pixel's offset (x, y) from the point in steps, from -last
/// to last: the inverse Fourier transform of lens times pixel.
cv::Mat1d shares(const PointSpreadFunction& spread, double disc_px, int last) {
    const int n = highest_frequency(spread, disc_px);
    const cv::Mat1d symmetric = symmetric_spectrum(spread, disc_px, n);
    cv::Mat2d spectrum(2 * n + 1, n + 1, cv::Vec2d(1, 0));
    if (spread.image) spectrum = image_spectrum(*spread.image, spread.samples_per_px, n);
    for (int j = -n; j <= n; ++j)
        for (int i = 0; i <= n; ++i)  // those of -i have the same real part
            spectrum(j + n, i) *= (i == 0 ? 1 : 2) * symmetric(std::abs(j), i);
    std::vector<double> places;
    for (int step = -last; step <= last; ++step) places.push_back(static_cast<double>(step) / kSteps);
    const cv::Mat2d sum = cv::Mat(waves(places, -n, n) * spectrum * waves(places, 0, n).t());
    cv::Mat1d real;
    cv::extractChannel(sum, real, 0);
    return real;
}

NARPA_EACH_ISA void add_row(const std::array<const float*, 4>& weights, const std::array<float, 4>& share,
                            const Rgb& light, Rgb* out, std::size_t n) noexcept {
    for (std::size_t i = 0; i < n; ++i) {
        const float w = share[0] * weights[0][i] + share[1] * weights[1][i] + share[2] * weights[2][i] +
                        share[3] * weights[3][i];
        out[i].x += w * light.x, out[i].y += w * light.y, out[i].z += w * light.z;
    }
}

}  // namespace

PointResponse::PointResponse(const PointSpreadFunction& spread, double disc_px)
    : radius_(radius_of(spread, disc_px)) {
    const int size = 2 * radius_ + 1, last = radius_ * kSteps + kSteps / 2;
    const cv::Mat1d share = shares(spread, disc_px, last);
    weights_.reserve(table(0, kSteps + 1));
    const auto place = [&](int pixel, int step) { return last + (pixel - radius_) * kSteps - step + kSteps / 2; };
    for (int step_y = 0; step_y <= kSteps; ++step_y)
        for (int step_x = 0; step_x <= kSteps; ++step_x) {
            double sum = 0;
            const auto at = [&](int x, int y) { return std::max(0.0, share(place(y, step_y), place(x, step_x))); };
            for (int y = 0; y < size; ++y)
                for (int x = 0; x < size; ++x) sum += at(x, y);
            for (int y = 0; y < size; ++y)
                for (int x = 0; x < size; ++x) weights_.push_back(static_cast<float>(at(x, y) / sum));
        }
}

void PointResponse::add(double point_x, double point_y, const Rgb& light, int y, int width,
                        Rgb* row) const noexcept {
    const double column = std::floor(point_x + 0.5), line = std::floor(point_y + 0.5);
    if (std::abs(column) > 1e6 || std::abs(y - line) > radius_) return;
    const int first = static_cast<int>(column) - radius_, size = 2 * radius_ + 1;
    const int begin = std::max(first, 0), end = std::min(first + size, width);
    if (begin >= end) return;
    const double steps_x = kSteps * (point_x + 0.5 - column), steps_y = kSteps * (point_y + 0.5 - line);
    const int step_x = std::min(static_cast<int>(steps_x), kSteps - 1);
    const int step_y = std::min(static_cast<int>(steps_y), kSteps - 1);
    const auto u = static_cast<float>(steps_x - step_x), v = static_cast<float>(steps_y - step_y);
    const auto from = static_cast<std::size_t>((y - static_cast<int>(line) + radius_) * size + begin - first);
    const auto weights = [&](int x, int y_step) { return &weights_[table(x, y_step) + from]; };
    add_row({weights(step_x, step_y), weights(step_x + 1, step_y), weights(step_x, step_y + 1),
             weights(step_x + 1, step_y + 1)},
            {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v}, light, row + begin,
            static_cast<std::size_t>(end - begin));
}

}  // namespace narpa
