#include "bench/convergence.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace narpa {
namespace {

/// Mean of independent values, its standard error from their scatter.
Estimate mean_of(std::span<const double> values) {
    const auto n = static_cast<double>(values.size());
    double sum = 0, squares = 0;
    for (const double v : values) sum += v;
    const double mean = sum / n;
    for (const double v : values) squares += (v - mean) * (v - mean);
    return {mean, values.size() < 2 ? 0 : std::sqrt(squares / (n * (n - 1)))};
}

/// Root of a mean of squares.
Estimate root(const Estimate& squares) {
    if (squares.value <= 0) return {};
    const double value = std::sqrt(squares.value);
    return {value, squares.standard_error / (2 * value)};
}

double band(std::span<const Rgb> image, std::size_t value) {
    return static_cast<double>(image[value / 3][static_cast<int>(value % 3)]);
}

}  // namespace

double Estimate::sigmas() const noexcept {
    if (value == 0) return 0;
    return standard_error > 0 ? value / standard_error
                              : std::copysign(std::numeric_limits<double>::infinity(), value);
}

void ImageMean::add(std::span<const Rgb> image) {
    std::vector<double>& mean = halves_[count() % 2];
    const double n = static_cast<double>(count() / 2 + 1);
    double sum = 0;
    for (std::size_t i = 0; i < mean.size(); ++i) {
        const double x = band(image, i);
        mean[i] += (x - mean[i]) / n;
        sum += x;
    }
    levels_.push_back(sum / static_cast<double>(mean.size()));
}

/// Share of this half in all images.
double ImageMean::share(std::size_t half) const noexcept {
    return static_cast<double>((count() + 1 - half) / 2) / static_cast<double>(count());
}

double ImageMean::mean(std::size_t value) const noexcept {
    return share(0) * halves_[0][value] + share(1) * halves_[1][value];
}

double ImageMean::variance_of_mean(std::size_t value) const noexcept {
    // A difference of means of n0 and n1 images has the variance s^2 (1 / n0 + 1 / n1), the mean of all s^2 / n.
    const double difference = halves_[0][value] - halves_[1][value];
    return share(0) * share(1) * difference * difference;
}

double ImageMean::variance_of_mean() const noexcept {
    double sum = 0;
    for (std::size_t i = 0; i < halves_[0].size(); ++i) sum += variance_of_mean(i);
    return sum / static_cast<double>(halves_[0].size());
}

Estimate ImageMean::level() const noexcept {
    return mean_of(levels_);
}

ErrorAgainst::ErrorAgainst(const ImageMean& reference)
    : reference_(reference), weights_(3 * reference.pixels()), images_(reference.pixels()) {
    const double least = 0.01 * reference.level().value;
    for (std::size_t i = 0; i < weights_.size(); ++i) {
        const double radiance = std::max(reference.mean(i), least);
        weights_[i] = radiance > 0 ? 1 / (radiance * radiance) : 0;
    }
}

void ErrorAgainst::add(std::span<const Rgb> image) {
    images_.add(image);
    double sum = 0, relative = 0;
    for (std::size_t i = 0; i < weights_.size(); ++i) {
        const double error = band(image, i) - reference_.mean(i);
        const double squared = error * error - reference_.variance_of_mean(i);
        sum += squared;
        relative += weights_[i] * squared;
    }
    squared_.push_back(sum / static_cast<double>(weights_.size()));
    squared_relative_.push_back(relative / static_cast<double>(weights_.size()));
}

ErrorRow ErrorAgainst::row(int spp) const {
    ErrorRow row{spp, images_.count(), root(mean_of(squared_)), root(mean_of(squared_relative_)), {}, {}};

    const Estimate level = images_.level(), truth = reference_.level();
    row.bias = {level.value - truth.value, std::hypot(level.standard_error, truth.standard_error)};

    std::vector<double> bias_squared(reference_.pixels());
    for (std::size_t i = 0; i < 3 * bias_squared.size(); ++i) {
        const auto error = [&](std::size_t half) {
            return images_.mean_of_half(half, i) - reference_.mean_of_half(half, i);
        };
        bias_squared[i / 3] += error(0) * error(1) / 3;
    }
    row.pixel_bias_squared = mean_of(bias_squared);
    return row;
}

Estimate fit_slope(std::span<const ErrorRow> rows, Estimate ErrorRow::*error) {
    struct Point {
        double x, y, weight;
    };
    std::vector<Point> points;
    for (const ErrorRow& r : rows) {
        const Estimate& e = r.*error;
        if (e.value <= 0) continue;
        const double relative = std::max(e.standard_error / e.value, 1e-12);
        points.push_back({std::log(r.spp), std::log(e.value), 1 / (relative * relative)});
    }
    double weights = 0, mean_x = 0, mean_y = 0;
    for (const Point& p : points) weights += p.weight, mean_x += p.weight * p.x, mean_y += p.weight * p.y;
    mean_x /= weights, mean_y /= weights;
    double xx = 0, xy = 0;
    for (const Point& p : points) {
        xx += p.weight * (p.x - mean_x) * (p.x - mean_x);
        xy += p.weight * (p.x - mean_x) * (p.y - mean_y);
    }
    if (points.size() < 2 || xx <= 0) return {};
    const double slope = xy / xx;
    double chi_squared = 0;
    for (const Point& p : points) {
        const double residual = p.y - mean_y - slope * (p.x - mean_x);
        chi_squared += p.weight * residual * residual;
    }
    const double freedom = static_cast<double>(points.size()) - 2;
    const double scatter = freedom > 0 ? std::max(1.0, chi_squared / freedom) : 1.0;
    return {slope, std::sqrt(scatter / xx)};
}

std::vector<std::string> convergence_faults(std::span<const ErrorRow> rows) {
    std::vector<std::string> faults;
    for (const ErrorRow& r : rows) {
        if (std::abs(r.bias.sigmas()) > kBiasSigmasMax)
            faults.push_back(fmt::format("at {} spp the mean error is {:.3g} +- {:.2g}: {:.1f} standard errors",
                                         r.spp, r.bias.value, r.bias.standard_error, r.bias.sigmas()));
        if (r.pixel_bias_squared.sigmas() > kBiasSigmasMax)
            faults.push_back(
                fmt::format("at {} spp pixels are off by {:.3g} rms beyond their noise: {:.1f} standard errors",
                            r.spp, std::sqrt(r.pixel_bias_squared.value), r.pixel_bias_squared.sigmas()));
    }
    if (rows.size() < 2) return faults;
    const auto judge = [&](const char* name, Estimate ErrorRow::*error) {
        const auto measured =
            std::count_if(rows.begin(), rows.end(), [&](const ErrorRow& r) { return (r.*error).value > 0; });
        const Estimate slope = fit_slope(rows, error);
        if (measured < 2)
            faults.push_back(
                fmt::format("the {} does not stand out from the reference's noise, so there is no slope: "
                            "take a better reference",
                            name));
        else if (slope.value - slope.standard_error > kSlopeMax)
            faults.push_back(fmt::format("the {} falls as spp^{:.3f} +- {:.3f}, expected {} or steeper", name,
                                         slope.value, slope.standard_error, kSlopeMax));
    };
    judge("error", &ErrorRow::rmse);
    judge("relative error", &ErrorRow::relative_rmse);
    return faults;
}

}  // namespace narpa
