#include "renderer/film/frame_error.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace narpa {
namespace {

/// Ratios of the variances of twice as many samples that are believed: from that of edges to that of independent
/// samples. Smooth pixels do better, but leave no error that counts; and where many edges have the same place in
/// their pixels, steps fall by chance faster than the error does.
constexpr double kLeastRatio = 0.353553, kMostRatio = 0.5;
/// Where only one doubling was seen: between edges and noise.
constexpr double kRatioOfTwo = 0.42;

double left_after(double step, double ratio) {
    return step * ratio / (1 - ratio);
}

}  // namespace

void FrameError::add_middles(const TileContrast& contrast, double tiles) noexcept {
    float sum = 0;
    for (const float m : contrast.middle) sum += m;
    middles_ += tiles * static_cast<double>(sum);
}

void FrameError::Part::add(const PixelMean& mean) noexcept {
    const auto level = static_cast<std::size_t>(std::bit_width(mean.count()) - 1);
    const auto squared = [](float step) { return static_cast<double>(step) * static_cast<double>(step); };
    steps[level].last += squared(mean.step());
    if (level > 1) steps[level].before += squared(mean.step_before());
    shares[level] += static_cast<double>(std::bit_floor(mean.count())) / mean.count();
    ++pixels[level];
}

void FrameError::add(const PixelMeans& means) noexcept {
    if (means.first.count() > 0) first_.add(means.first);
    if (means.by_paths.count() > 0) by_paths_.add(means.by_paths);
}

void FrameError::add_tile(const TileContrast& contrast, const PerPixel<PixelMeans>& means) noexcept {
    for (std::size_t i = 0; i < kTilePixels; ++i)
        if (means[i].any())
            add(means[i]);
        else
            middles_ += static_cast<double>(contrast.middle[i]);
}

FrameError::Part& FrameError::Part::operator+=(const Part& b) noexcept {
    for (std::size_t i = 0; i < kDoublings; ++i) {
        steps[i].last += b.steps[i].last;
        steps[i].before += b.steps[i].before;
        shares[i] += b.shares[i];
        pixels[i] += b.pixels[i];
    }
    return *this;
}

FrameError& FrameError::operator+=(const FrameError& b) noexcept {
    middles_ += b.middles_;
    first_ += b.first_;
    by_paths_ += b.by_paths_;
    return *this;
}

double FrameError::Part::squared_error() const noexcept {
    double sum = 0;
    for (std::size_t level = 1; level < kDoublings; ++level) {
        if (pixels[level] == 0) continue;
        const auto [last, before] = steps[level];
        const double ratio =
            level == 1 || before == 0 ? kRatioOfTwo : std::clamp(last / before, kLeastRatio, kMostRatio);
        sum += left_after(last, ratio) * shares[level] / static_cast<double>(pixels[level]);
    }
    return sum;
}

double FrameError::standard_error(std::size_t pixels) const noexcept {
    const double sum = middles_ + first_.squared_error() + by_paths_.squared_error();
    return std::sqrt(sum / static_cast<double>(pixels));
}

}  // namespace narpa
